"""Object colour: displays, interfaces, shading, glazes as a material, interreflection (paper B), and scenes of them."""
