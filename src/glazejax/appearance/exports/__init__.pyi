from .angles import AngularColour as AngularColour
from .angles import angular_colour as angular_colour
from .fit import OpenPBRFit as OpenPBRFit
from .fit import fit_openpbr as fit_openpbr
from .fit import material_errors as material_errors
from .materialx import write_materialx as write_materialx
from .openpbr import OpenPBR as OpenPBR
from .openpbr import directional_albedo as directional_albedo
from .openpbr import reflectance_factor as reflectance_factor
from .openpbr import surface_albedo as surface_albedo
from .textures import TextureSet as TextureSet
from .textures import texture_set as texture_set

__all__: list[str]
