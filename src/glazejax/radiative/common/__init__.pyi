from . import fresnel as fresnel
from . import phase as phase

__all__: list[str]
