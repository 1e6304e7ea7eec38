"""Which materials a surface's colour rules out: wood, brick and stone are neither blue nor green.

What colours them (lignin and tannin in wood, oxides of iron in brick and stone, melanin in hair, melanin and blood in
skin) reflects more the longer the wavelength, so that they are yellowish, reddish or grey in any light that is near
white. A surface that looks blue is none of them, however much its grain looks like wood's: it is dyed or painted.
`research/benchmarks/segmentation.py --spectraldb FILE` prints how far measured surfaces go.

Other classes come in any colour and are left as they are: this can only take a class away, never name one.
"""

import numpy as np

from lidarspectra.arrays import FloatArray

UNDYED = ("brick", "hair", "skin", "stone", "wood")  # classes whose pigments are their own
CAST = 6.0  # [1] L*a*b* units that a phone's white balance may be off; none of 242 measured surfaces goes so far
# but one piece of wood
SPREAD = 4.0  # [1] L*a*b* units, standard deviation beyond that
MIN_LIKELIHOOD = 0.01  # [1] no colour excludes a class for certain


def color_likelihood(lab: FloatArray, classes: tuple[str, ...]) -> FloatArray:
    """How likely a surface of each class looks so, against a surface of any colour.

    Half a normal distribution of how much bluer (-b*) or greener (-a*), whichever is more, than `CAST` the surface is.

    Parameters
    ----------
    lab : (face, 3) float
        L*, a*, b*; NaN where nothing is known of the colour.
    classes : tuple of str
        Of the model; those that it has beside `UNDYED` get 1.

    Returns
    -------
    likelihood : (face, class) float
        [0-1]
    """
    beyond = np.nan_to_num(np.maximum(-lab[:, 1:].min(axis=1) - CAST, 0.0))
    undyed = np.maximum(np.exp(-0.5 * (beyond / SPREAD) ** 2), MIN_LIKELIHOOD)
    likelihood = np.ones((len(lab), len(classes)))
    likelihood[:, [name in UNDYED for name in classes]] = undyed[:, None]
    return likelihood
