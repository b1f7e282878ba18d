"""Object colour: displays, interfaces, shading, glazes as a material, interreflection (paper B),
and scenes of them.

`Display` leads from XYZ to digital RGB and back, `metal` gives complex refractive indices,
`glaze_table` makes a glaze a material; `shading` and `interreflection` are functions of cosines and
spectra. A `Scene` of shapes, materials, lights (`lamp`) and a `Camera` is computed by `render`, and
shown by `picture_xyz` and `screen_picture`. Nothing is imported before it is asked for.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
