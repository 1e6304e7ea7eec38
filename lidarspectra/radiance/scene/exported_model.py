"""The Radiance model as a folder that needs nothing but Radiance: scene text, options, `.rif` and Makefile.

`make` there compiles the meshes and octrees, traces every pass (side by side with `make -j`) and adds them up in
`irradiance.txt`: one line a sensor, x y z nx ny nz and the irradiance of each band [W/m²/nm], shortest wavelength
first. It is the run's answer within noise. With panes of glass a pass is three runs of rtrace, which are added up
(`pane_text`). Only oconv, obj2mesh, rtrace, rcalc, rlam and total are called, and those of Radiance's function files
that they read lie beside the model, so that RAYPATH need not be set. No step needs quotes.
Each program is a step of its own and not part of a pipe, whose status would be the last one's: a program that fails
ends make with a status other than 0, and so does a table with fewer rows than there are sensors (`check`).
"""

import shutil
import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.errors import SceneError
from lidarspectra.io.files import writing
from lidarspectra.radiance.engine.bands import WRITTEN_PER_WATT
from lidarspectra.radiance.engine.engine import Engine, find_engine
from lidarspectra.radiance.engine.options import Accuracy, Noise, noise_level, plain_arguments, reflections_in_words
from lidarspectra.radiance.scene.lamp_text import candela_file
from lidarspectra.radiance.scene.pane_text import GLASS_FILE
from lidarspectra.radiance.scene.scene_record import LAMPS_FILE, PlainTrace, RadianceScene, ScenePass
from lidarspectra.room.sensor_points import SensorPoints

MAKEFILE = "Makefile"
README_FILE = "README.txt"
README_COLUMNS = 100
POINTS_FILE = "points.txt"
TRACE_OPTIONS_FILE = "trace.opt"  # of as many reflections as the accuracy has; trace0.opt and trace1.opt of so many
REPEAT_FILE = "repeat.fmt"
ANSWER_FILE = "irradiance.txt"
FUNCTION_FILES = ("rayinit.cal", "source.cal")  # read by every program, and for the intensity tables of 'ies' lamps
PICTURE_EYE_HEIGHT_M = 1.6  # [m] of the view that `rad` is given


def write_workflow(
    scene: RadianceScene,
    points: SensorPoints,
    folder: Path,
    *,
    accuracy: Accuracy = "high",
    noise: Noise = "standard",
    engine: Engine | None = None,
) -> Path:
    """Write the model into a folder of its own.

    Parameters
    ----------
    scene : RadianceScene
        Its text is copied; octrees and compiled meshes are left for `make`.
    points : SensorPoints
        Sensors with the cosine receptor.
    folder : Path
        Made if it is not there.
    accuracy, noise : str
        As in `trace`.
    engine : Engine, optional
        Whose function files are put beside the model. Default: the one that pyradiance brings.

    Returns
    -------
    makefile : Path

    Raises
    ------
    SceneError
        If a file of the scene is not there, or the folder cannot be written.
    """
    library = (find_engine() if engine is None else engine).library
    with writing(
        folder,
        error=SceneError,
        expected="a scene that can be copied, and a folder that can be written",
        todo="Make the scene stage again, or name another folder.",
    ):
        folder.mkdir(parents=True, exist_ok=True)
        for name in _scene_files(scene):
            shutil.copyfile(scene.folder / name, folder / name)
        for name in FUNCTION_FILES:
            shutil.copyfile(library / name, folder / name)
        for name, text in _texts(scene, points, accuracy, noise).items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
    return folder / MAKEFILE


def _scene_files(scene: RadianceScene) -> list[str]:
    files = [LAMPS_FILE, *sorted({scene_pass.mesh for scene_pass in scene.passes})]
    for scene_pass in scene.passes:
        files += [scene_pass.scene_file, scene_pass.materials_file, *scene_pass.data_files]
        if scene_pass.has_glass:
            files += [f"{plain.name}.rad" for plain in scene_pass.plain_traces]
            files += [scene_pass.panes_materials_file, GLASS_FILE]
    data = [candela_file(name) for name in scene.lamp_modifiers]
    return list(dict.fromkeys(files + [name for name in data if (scene.folder / name).is_file()]))


def _texts(scene: RadianceScene, points: SensorPoints, accuracy: Accuracy, noise: Noise) -> dict[str, str]:
    lamp_count = max(len(scene_pass.lamps) for scene_pass in scene.passes)
    texts = {
        POINTS_FILE: _points_text(points),
        REPEAT_FILE: "${$1} ${$2} ${$3} ${$4} ${$5} ${$6}\n" * noise_level(noise).exported_repeats,
        "sum.cal": _sum_text(scene),
        "bands.txt": _bands_text(scene),
        README_FILE: _readme_text(scene, accuracy, noise),
        MAKEFILE: _makefile_text(scene, len(points), noise_level(noise).exported_repeats),
    }
    for bounces in {plain.bounces for scene_pass in scene.passes for plain in scene_pass.plain_traces}:
        options = plain_arguments(accuracy, "draft", lamp_count=lamp_count, relays=scene.relays, bounces=bounces)
        texts[_options_file(bounces)] = " ".join(options) + "\n"
    for scene_pass in scene.passes:
        slots = [*scene_pass.group.options, "-co+"] if scene.mode == "native" else []
        texts[f"{scene_pass.name}.opt"] = " ".join([*slots, ""]) + "\n"
        texts[f"{scene_pass.name}.rif"] = _rif_text(scene_pass, points)
    return texts


def _readme_text(scene: RadianceScene, accuracy: Accuracy, noise: Noise) -> str:
    """What the files are, for somebody who has Radiance and not this package; no words of the user's stand in it."""
    paragraphs = [
        f"'make -j' computes {ANSWER_FILE} with Radiance 6 (oconv, obj2mesh, rtrace, rcalc, rlam, total); 'make clean' "
        "takes away what it made. 'rad pass0.rif', after 'make pass0.oct', renders a picture in false colours.",
        f"{ANSWER_FILE}: a line a sensor; bands.txt names its columns. Irradiance is in W/m2/nm, places in metres, "
        f"z up. {POINTS_FILE}: the sensors, place and direction. {LAMPS_FILE}: the lamps' shapes. room.obj: the "
        "room's mesh. passN.rad: what the lamps of a pass send. passN_materials.rad: its materials.",
        "The samples of a pass are slots, not wavelengths: parts of the sensor's channels in ascending order, whatever "
        "their spacing; the wavelengths in the files and in passN.opt only make Radiance copy them as they are. "
        "sum.cal adds them up. Lamps are in microwatts, so that an answer divided by 1e6 is in watts. Radiance "
        "answers from the long end to the short one.",
        f"Light is followed for {reflections_in_words(accuracy)}; each sensor is traced "
        f"{noise_level(noise).exported_repeats} times. The lamps are those that were traced: dimming, fluxes or "
        "spectra that were changed later are in the run's map and not here.",
    ]
    if any(scene_pass.has_glass for scene_pass in scene.passes):
        paragraphs.append(
            "With panes of glass a pass is three runs of rtrace, which sum.cal adds up: passN_glow has all light, but "
            "what glass mirrors of the lamps comes from all of the pane; passN_images what comes straight from the "
            "lamps and from their images in the panes; passN_panes what both of these have, and is taken off. "
            "passN.oct, which rad renders, has no lamps mirrored in glass."
        )
    return "\n".join(textwrap.fill(words, README_COLUMNS) + "\n" for words in paragraphs)


def _options_file(bounces: int | None) -> str:
    return TRACE_OPTIONS_FILE if bounces is None else f"trace{bounces}.opt"


def _points_text(points: SensorPoints) -> str:
    rows = np.concatenate([points.positions, points.normals], axis=1).tolist()
    return "".join(" ".join(f"{value:.9g}" for value in row) + "\n" for row in rows)


def _bands_text(scene: RadianceScene) -> str:
    columns = ["x_m", "y_m", "z_m", "nx", "ny", "nz", *(f"E_{label}" for label in scene.bands.labels)]
    return "".join(f"{number} {name}\n" for number, name in enumerate(columns, start=1))


def _sum_text(scene: RadianceScene) -> str:
    """Column formulas for rcalc: 6 columns of the sensor, then every channel as its slots by their shares, in W/m²/nm.

    rlam puts the columns of all runs of rtrace side by side, each from its last slot to its first.
    """
    terms: list[list[str]] = [[] for _ in range(len(scene.bands))]
    column = 6
    for scene_pass, plain in _traces(scene):
        for place, slot in enumerate(scene_pass.slots):
            share = plain.sign * scene.slots.share[slot]
            weight = "" if share == 1.0 else f"{share:.9g}*"
            terms[scene.slots.channel[slot]].append(f"{weight}${column + scene_pass.slot_count - place}")
        column += scene_pass.slot_count
    lines = [f"${number}=${number};" for number in range(1, 7)]
    unit = f"{1.0 / WRITTEN_PER_WATT:g}"
    lines += [f"${number}={unit}*({'+'.join(parts)});" for number, parts in enumerate(terms, start=7)]
    return "\n".join(lines) + "\n"


def _makefile_text(scene: RadianceScene, sensors: int, repeats: int) -> str:
    data = " ".join(f"{plain.name}.dat" for _, plain in _traces(scene))
    head = (
        f"# Irradiance at the sensors of {POINTS_FILE}, by Radiance 6 alone; make -j runs the passes side by side.\n"
        f"# {ANSWER_FILE}: its columns are named in bands.txt; irradiance in W/m2/nm.\n"
        "# Radiance's function files stand beside this one; a RAYPATH that is set is searched after this folder.\n"
        "export RAYPATH := .:$(RAYPATH)\n"
        "export LC_ALL := C\n"
        f"SENSORS := {sensors}\n\n"
        "# Refuses a table that has not a row for every sensor: Radiance may end well without an answer.\n"
        "check = test $$(wc -l < $@) -eq $(1) || "
        "{ echo $@ has not the $(1) rows that it should have, see the lines above >&2; exit 1; }\n\n"
        f"all: {ANSWER_FILE}\n\n"
        f"{ANSWER_FILE}: joined.tmp sum.cal\n"
        "\trcalc -f ./sum.cal joined.tmp > $@\n"
        "\t@$(call check,$(SENSORS))\n\n"
        f"joined.tmp: {POINTS_FILE} {data}\n"
        f"\trlam {POINTS_FILE} {data} > $@\n"
        "\t@$(call check,$(SENSORS))\n\n"
        f"rays.tmp: {REPEAT_FILE} {POINTS_FILE}\n"
        f"\trcalc -o {REPEAT_FILE} {POINTS_FILE} > $@\n"
        f"\t@$(call check,{sensors * repeats})\n"
    )
    rules = "".join(_pass_rules(scene_pass, sensors, repeats) for scene_pass in scene.passes)
    octrees = sorted({name for each, plain in _traces(scene) for name in (each.octree, plain.octree)})
    glass = {scene_pass.panes_mesh_file for scene_pass in scene.passes if scene_pass.has_glass}
    meshes = sorted({scene_pass.mesh_file for scene_pass in scene.passes} | glass)
    traced = " ".join(f"{plain.name}.tmp" for _, plain in _traces(scene))
    made = " ".join([data, *octrees, *meshes, ANSWER_FILE, traced, "rays.tmp", "joined.tmp"])
    return f"{head}{rules}\nclean:\n\trm -f {made}\n\n.PHONY: all clean\n.DELETE_ON_ERROR:\n"


def _traces(scene: RadianceScene) -> list[tuple[ScenePass, PlainTrace]]:
    """The runs of rtrace, in the order of their columns."""
    return [(scene_pass, plain) for scene_pass in scene.passes for plain in scene_pass.plain_traces]


def _pass_rules(scene_pass: ScenePass, sensors: int, repeats: int) -> str:
    """How make compiles and traces a pass; passes that share their surfaces leave the mesh to the first."""
    name = scene_pass.name
    rules = ""
    if scene_pass.surfaces == name:
        rules += _mesh_rule(scene_pass.mesh_file, scene_pass.materials_file, scene_pass.mesh)
    rules += _octree_rule(scene_pass.octree, [scene_pass.scene_file], scene_pass.mesh_file, scene_pass)
    if scene_pass.has_glass:
        if scene_pass.surfaces == name:
            rules += _mesh_rule(scene_pass.panes_mesh_file, scene_pass.panes_materials_file, scene_pass.mesh)
        glow, images = f"{name}_glow", f"{name}_images"
        for sheets in (glow, images):
            texts = [scene_pass.scene_file, f"{sheets}.rad"]
            rules += _octree_rule(f"{sheets}.oct", texts, scene_pass.mesh_file, scene_pass)
        texts = [f"{scene_pass.panes}.rad", f"{glow}.rad"]
        rules += _octree_rule(f"{scene_pass.panes}.oct", texts, scene_pass.panes_mesh_file, scene_pass)
    return rules + "".join(_trace_rule(plain, name, sensors, repeats) for plain in scene_pass.plain_traces)


def _mesh_rule(compiled: str, materials: str, mesh: str) -> str:
    return f"\n{compiled}: {mesh} {materials}\n\tobj2mesh -a {materials} {mesh} > $@\n"


def _octree_rule(octree: str, texts: Sequence[str], mesh_file: str, scene_pass: ScenePass) -> str:
    """The first text, the lamps' shapes, and the rest, in the order of the run."""
    read = " ".join([texts[0], LAMPS_FILE, *texts[1:]])
    glass = [GLASS_FILE] if len(texts) > 1 else []
    return f"\n{octree}: {' '.join([read, mesh_file, *scene_pass.data_files, *glass])}\n\toconv {read} > $@\n"


def _trace_rule(plain: PlainTrace, pass_name: str, sensors: int, repeats: int) -> str:
    name, options = plain.name, f"{_options_file(plain.bounces)} {pass_name}.opt"
    at = " ".join(f"@{file}" for file in options.split())
    return (
        f"\n{name}.tmp: {plain.octree} rays.tmp {options}\n"
        f"\trtrace -h {at} {plain.octree} < rays.tmp > $@\n"
        f"\t@$(call check,{sensors * repeats})\n"
        f"\n{name}.dat: {name}.tmp\n\ttotal -m -{repeats} {name}.tmp > $@\n\t@$(call check,$(SENSORS))\n"
    )


def _rif_text(scene_pass: ScenePass, points: SensorPoints) -> str:
    """Control file for `rad`: the pass as it is, with a view from the middle of the sensors."""
    low, high = points.positions.min(axis=0), points.positions.max(axis=0)
    margin = 1.0  # [m] the sensors' own box has no height
    zone = " ".join(f"{a - margin:.3f} {b + margin:.3f}" for a, b in zip(low, high, strict=True))
    eye = (*(0.5 * (low + high))[:2], low[2] + PICTURE_EYE_HEIGHT_M)
    view = " ".join(f"{value:.3f}" for value in eye)
    render = " ".join(scene_pass.group.options)
    return (
        f"# A picture by rad, after 'make {scene_pass.octree}'. Slots are opaque channels, so its colours are false.\n"
        f"ZONE= I {zone}\n"
        f"scene= {scene_pass.scene_file} {LAMPS_FILE}\n"
        f"OCTREE= {scene_pass.octree}\n"
        "oconv= -f\n"
        "INDIRECT= 2\nQUALITY= M\nDETAIL= M\nVARIABILITY= M\nEXPOSURE= -24\nUP= Z\n"
        + (f"render= {render}\n" if render else "")
        + f"view= inside -vtv -vp {view} -vd 0 1 0 -vu 0 0 1 -vh 100 -vv 80\n"
        f"PICTURE= {scene_pass.name}\n"
    )
