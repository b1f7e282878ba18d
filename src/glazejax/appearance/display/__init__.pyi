from .display import PRESETS as PRESETS
from .display import Digital as Digital
from .display import Display as Display
from .tone import ToneCurve as ToneCurve
from .tone import look_up as look_up
