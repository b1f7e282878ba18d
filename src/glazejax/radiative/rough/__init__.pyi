from .ports import Ports as Ports
from .ports import rough_ports as rough_ports
from .reflectance import rough_hemispherical_reflectance as rough_hemispherical_reflectance
from .reflectance import rough_reflectance_factor as rough_reflectance_factor
from .surface import loss_constant as loss_constant
from .surface import surface_albedo as surface_albedo
from .surface import surface_loss as surface_loss
from .surface import surface_reflectance_factor as surface_reflectance_factor
