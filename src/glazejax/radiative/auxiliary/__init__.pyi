from .kernel_table import KernelTable as KernelTable
from .uniform import reflectance_factor as reflectance_factor
from .uniform import split_reflectance_factor as split_reflectance_factor
