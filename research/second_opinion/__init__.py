"""A second opinion on the light: the same scene, the same points, another engine (extra `validate`).

Mitsuba 3 (Jakob et al. 2022) traces unbiased paths with emitter sampling and no limit to their length. It shares no
code with Radiance, and of ours only what both engines must be told alike: the mesh with its corner normals, the
material of every face with its reflectance in each band slot, the lamps' shapes and their flux. So where both agree,
our passes, our split of the light, our options and our reading of the engine's output are right.

    variants.py    which Mitsuba runs on this machine
    plugins.py     surfaces and lamps that Mitsuba does not bring
    export.py      scan, materials and lamps as a Mitsuba scene
    reference.py   irradiance at sensor points, with its standard error

Nothing that a run needs imports this package.

References
----------
Jakob W, Speierer S, Roussel N, Vicini D (2022), Dr.Jit: a just-in-time compiler for differentiable rendering, ACM
Transactions on Graphics 41(4), 124.
"""

from research.second_opinion.reference import Reference as Reference
from research.second_opinion.reference import reference_irradiance as reference_irradiance
