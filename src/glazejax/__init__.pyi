import types

from . import appearance as appearance
from . import catalogue as catalogue
from . import cie as cie
from . import colour as colour
from . import geometry as geometry
from . import io as io
from . import paint as paint
from . import plots as plots
from . import radiative as radiative
from . import samples as samples
from . import spectra as spectra
from . import studio as studio
from .geometry import Bidirectional as Bidirectional
from .geometry import Hemispherical as Hemispherical
from .geometry import Instrument as Instrument
from .interpolated import interpolated as interpolated
from .paint.media import Glaze as Glaze
from .paint.media import Layer as Layer
from .paint.media import Mixture as Mixture
from .paint.media import Pigment as Pigment
from .paint.media import amounts as amounts
from .picture import picture as picture
from .program_cache import enable_program_cache as enable_program_cache
from .radiative.profile import (
    profile_hemispherical_reflectance as profile_hemispherical_reflectance,
)
from .radiative.profile import profile_reflectance_factor as profile_reflectance_factor
from .radiative.rough import rough_hemispherical_reflectance as rough_hemispherical_reflectance
from .radiative.rough import rough_reflectance_factor as rough_reflectance_factor
from .radiative.stack import split_hemispherical_reflectance as split_hemispherical_reflectance
from .radiative.stack import split_reflectance_factor as split_reflectance_factor
from .radiative.stack import stack_hemispherical_reflectance as stack_hemispherical_reflectance
from .radiative.stack import stack_reflectance_factor as stack_reflectance_factor
from .reflectance import reflectance as reflectance
from .stacks import load_glaze as load_glaze
from .stacks import save_glaze as save_glaze

__version__: str

fit: types.ModuleType

__all__: list[str]
