"""The paper's experiments (its Section 3) on rooms whose truth is known: what is run, measured, drawn and told.

    true_light.py        the light that is truly there, from true geometry and spectra at full spectral resolution
    true_light_file.py   that light as it is stored beside a scene
    variants.py          run files of a scene with something changed, so that every experiment is an ordinary run
    accuracy.py          Tables 1 and 2: a map against the truth, in the paper's measures
    microbenchmarks.py   Figures 8 to 11: inverse square, superposition, reflectance
    sensitivity.py       which input matters most
    *_figures.py         what is drawn of all that

`benchmarks/experiments.py` runs them all and writes docs/results.md.
"""
