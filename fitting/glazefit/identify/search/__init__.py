"""The search: from spectra to candidates and their odds; screen, fit, refine, weigh."""
