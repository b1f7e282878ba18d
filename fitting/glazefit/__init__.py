"""From measured paint to its absorption and scattering: the inverse of `glazejax`.

Read films with `read_films`, recover k and s with `recover_films`, and make test films with
`simulate_films`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
