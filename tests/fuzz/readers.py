"""Every reader of users' files, with valid files to start from, and the damage that is done to them."""

import io
import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import mutations as m
import numpy as np
import rooms

Files = dict[str, bytes]
PROJECT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True, kw_only=True)
class Reader:
    """A reader under trial.

    Parameters
    ----------
    name : str
    seeds : callable
        Valid files by name, a set for each variant; the first of a set is given to the reader. The folder is for
        libraries that write files only.
    read : callable
        Given the path of the first file; what it gives is thrown away.
    damage : tuple of Mutator
        Chosen by lot.
    cases_a_process : int
        After so many the campaign starts a fresh process; few where a library keeps what it was given.
    most_cases : int
        In a campaign; fewer where a case takes seconds.
    case_s : float
        Processor time that a case may take. [s]
    starts_programs : bool
        Whether it may start programs: Radiance's.
    """

    name: str
    seeds: Callable[[Path], Iterator[Files]]
    read: Callable[[Path], object]
    damage: tuple[m.Mutator, ...]
    cases_a_process: int = 5_000
    most_cases: int = 10_000
    case_s: float = 20.0  # the largest image that is allowed takes two
    starts_programs: bool = False


# --- scans


def box() -> "object":
    import trimesh

    solid = trimesh.creation.box(extents=(3, 2.5, 4))
    solid.unmerge_vertices()
    return solid


def picture(size: int = 8) -> "np.ndarray":
    return np.random.default_rng(0).integers(0, 255, (size, size, 3), dtype=np.uint8)


def textured(material: str) -> "object":
    import trimesh
    from PIL import Image

    solid = box()
    uv = np.random.default_rng(1).random((len(solid.vertices), 2))
    image = Image.fromarray(picture())
    if material == "pbr":
        look = trimesh.visual.material.PBRMaterial(baseColorTexture=image)
    else:
        look = trimesh.visual.material.SimpleMaterial(image=image)
    solid.visual = trimesh.visual.TextureVisuals(uv=uv, material=look)
    return solid


def glb_seeds(folder: Path) -> Iterator[Files]:
    yield {"a.glb": textured("pbr").export(file_type="glb")}


def gltf_seeds(folder: Path) -> Iterator[Files]:
    import trimesh

    files = trimesh.Scene(textured("pbr")).export(file_type="gltf")
    yield {"a.gltf": files.pop("model.gltf"), **files}


def obj_seeds(folder: Path) -> Iterator[Files]:
    textured("simple").export(folder / "a.obj")
    found = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    yield {"a.obj": found.pop("a.obj"), **found}


def mtl_seeds(folder: Path) -> Iterator[Files]:
    """The same, with the damage in the MTL: the first file is what is damaged, the mesh is found by its ending."""
    (files,) = obj_seeds(folder)
    material = next(name for name in files if name.endswith(".mtl"))
    yield {material: files.pop(material), **files}


def ply_seeds(folder: Path) -> Iterator[Files]:
    import trimesh

    solid = box()
    solid.visual.vertex_colors = np.random.default_rng(2).integers(0, 255, (len(solid.vertices), 4))
    for encoding in ("ascii", "binary"):
        yield {"a.ply": trimesh.exchange.ply.export_ply(solid, encoding=encoding)}


def stl_seeds(folder: Path) -> Iterator[Files]:
    import trimesh

    yield {"a.stl": box().export(file_type="stl")}
    yield {"a.stl": trimesh.exchange.stl.export_stl_ascii(box()).encode()}


def usd_seeds(folder: Path) -> Iterator[Files]:
    from pxr import Usd, UsdGeom, UsdUtils

    solid = box()
    for suffix in (".usdc", ".usda"):
        inner = folder / f"inner{suffix}"
        stage = Usd.Stage.CreateNew(str(inner))
        mesh = UsdGeom.Mesh.Define(stage, "/m")
        mesh.CreatePointsAttr([tuple(map(float, point)) for point in solid.vertices])
        mesh.CreateFaceVertexCountsAttr([3] * len(solid.faces))
        mesh.CreateFaceVertexIndicesAttr([int(number) for number in solid.faces.ravel()])
        stage.Save()
        assert UsdUtils.CreateNewUsdzPackage(str(inner), str(folder / "a.usdz"))
        yield {"a.usdz": (folder / "a.usdz").read_bytes()}
        if suffix == ".usda":
            yield {"a.usda": inner.read_bytes()}


def room_seeds(folder: Path) -> Iterator[Files]:
    yield {"room.glb": rooms.glb(rooms.plain_room(np.random.default_rng(3)))}


def read_a_room(path: Path) -> object:
    """From the scan to the Radiance scene; with the light taken out of every fourth room's colours."""
    import lidarspectra as ls

    delight = path.stat().st_size % 16 == 0  # of a GLB a multiple of 4
    cheap = ls.init(path).changed(materials={"coverage": 0.2, "delight": delight})  # one viewpoint, mostly
    return ls.run(cheap, path.parent / "room.run", last="scene", workers=1)


def capture_seeds(folder: Path) -> Iterator[Files]:
    """Raw data of apps, as archives."""
    import shutil
    import sys

    sys.path.append(str(PROJECT / "tests" / "unit" / "scan"))
    import capture_layouts as layouts

    room = layouts.box_room()
    shots = layouts.gray_shots(room, 3)
    layouts.write_3dscanner(folder / "scanner", room, shots)
    layouts.write_polycam(folder / "polycam", room, shots, layouts.turning_pose(20.0, 0.0))
    layouts.write_stray(folder / "stray", shots)
    yield {"a.zip": layouts.write_record3d(folder / "a.r3d", shots).read_bytes()}
    for name in ("scanner", "polycam", "stray"):
        archive = Path(shutil.make_archive(str(folder / name), "zip", folder / name))
        yield {"a.zip": archive.read_bytes()}


def read_a_capture(path: Path) -> object:
    """Mesh, poses, pictures and depths; a frame may be at fault by itself."""
    from lidarspectra.hardware.phone.frames import FrameFault
    from lidarspectra.hardware.phone.readers import read_scan_and_frames

    scan, capture = read_scan_and_frames(path)
    assert capture is not None
    for frame in capture.frames:
        assert np.isfinite(frame.camera_to_world).all()
        for read in (lambda frame=frame: frame.read_image(64), frame.read_depth):
            try:
                read()
            except FrameFault as fault:
                str(fault)
    return scan


def read_a_scan(path: Path) -> object:
    from lidarspectra.hardware.phone.readers import read_scan

    if path.suffix == ".mtl":
        path = path.with_name("a.obj")
    scan = read_scan(path)
    assert np.isfinite(scan.vertices).all()
    assert np.isfinite(scan.face_colors()).all()
    return scan


# --- textures

IMAGES = {
    "PNG": ("1", "L", "LA", "P", "RGB", "RGBA", "I;16"),
    "JPEG": ("L", "RGB", "CMYK"),
    "WEBP": ("RGB", "RGBA"),
    "BMP": ("1", "L", "P", "RGB"),
    "TIFF": ("1", "L", "RGB", "RGBA", "CMYK", "I;16", "F", "LAB"),
    "TGA": ("L", "RGB", "RGBA"),
    "GIF": ("P",),
}


def image_in(mode: str) -> "object":
    from PIL import Image

    pixels = picture(24)
    if mode == "I;16":
        return Image.fromarray(pixels[:, :, 0].astype(np.uint16) * 257)
    if mode == "F":
        return Image.fromarray(pixels[:, :, 0].astype(np.float32) / 255.0)
    if mode == "LAB":
        return Image.frombytes("LAB", (24, 24), pixels.tobytes())
    return Image.fromarray(pixels).convert(mode)


def texture_seeds(folder: Path) -> Iterator[Files]:
    for kind, modes in IMAGES.items():
        for mode in modes:
            stream = io.BytesIO()
            image_in(mode).save(stream, format=kind)
            yield {"texture": stream.getvalue()}


def read_a_texture(path: Path) -> object:
    from lidarspectra.geometry.textures import decode_image

    decoded = decode_image(path.read_bytes(), name="texture")
    assert decoded.dtype == np.uint8
    assert decoded.ndim == 3
    assert decoded.shape[2] == 3
    return decoded


def damage_a_texture(data: bytes, rng: m.Generator) -> bytes:
    return m.change_png(data, rng) if data.startswith(b"\x89PNG") and rng.random() < 0.7 else m.raw(data, rng)


# --- texts


def run_file_seeds(folder: Path) -> Iterator[Files]:
    for path in sorted((PROJECT / "scenes").glob("*/room.toml")):
        yield {"room.toml": path.read_bytes()}
    yield {
        "room.toml": b"""[scan]
file = "scan.glb"
unit = "mm"
up = "+y"
max_hole_m = 0.5
[lamps_from_scan]
cct_k = 4000
fluxes = "area"
[daylight]
latitude_deg = 48.1
longitude_deg = 11.6
time = 2024-06-21T12:00:00+02:00
[[daylight.windows]]
name = "window"
center = [0.05, 1.0, 1.5]
size = [1.0, 1.0]
normal = [1, 0, 0]
[materials]
method = "file"
file = "a.csv"
databases = ["builtin"]
[sensors]
points = "points.csv"
field_of_view_deg = 20
[trace]
accuracy = "low"
noise = "draft"
workers = 2
[people_and_plants]
rendering = false
[[cells]]
cell = "silicon"
area_cm2 = 36
hours = "8:30-17"
"""
    }


def read_a_run_file(path: Path) -> object:
    from lidarspectra.workflow.run_folder.inputs import read_inputs

    return read_inputs(path)


def plan_seeds(folder: Path) -> Iterator[Files]:
    for scene in sorted((PROJECT / "scenes").iterdir()):
        if (scene / "plan.toml").is_file():
            text = (scene / "plan.toml").read_text(encoding="utf-8").replace("../reflectances.csv", "reflectances.csv")
            table = (scene.parent / "reflectances.csv").read_bytes()
            yield {"plan.toml": text.encode(), "reflectances.csv": table}


def read_a_plan(path: Path) -> object:
    from research.virtual_rooms.room_plan import read_plan

    return read_plan(path)


def card_seeds(folder: Path) -> Iterator[Files]:
    from lidarspectra.material.segmentation.segmentation import SHIPPED_MODEL

    yield {"model.toml": SHIPPED_MODEL.with_suffix(".toml").read_bytes()}
    yield {
        "model.toml": b'classes = ["wood", "tile", "sky"]\nleave_out = ["sky"]\ninput_px = 32\nstride_px = 32\n'
        b'mean = [1.0, 2, 3]\nscale = [1, 1, 0.5]\nchannels = "BGR"\noutput = "probabilities"\n[about]\ndata = "none"\n'
    }


def read_a_card(path: Path) -> object:
    from lidarspectra.material.segmentation.model_card import read_card

    return read_card(path.with_suffix(".onnx"))


def model_seeds(folder: Path) -> Iterator[Files]:
    from onnx import TensorProto, helper, numpy_helper

    weight = np.random.default_rng(4).random((3, 3, 8, 8), dtype=np.float32)
    graph = helper.make_graph(
        [helper.make_node("Conv", ["x", "w"], ["y"], strides=[8, 8])],
        "g",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, [1, 3, "h", "v"])],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, [1, 3, "a", "b"])],
        [numpy_helper.from_array(weight, "w")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    card = b'classes = ["wood", "tile", "metal"]\ninput_px = 16\nstride_px = 8\n'
    yield {"model.onnx": model.SerializeToString(), "model.toml": card}


def read_a_model(path: Path) -> object:
    from lidarspectra.material.segmentation.segmentation import Classifier

    return Classifier(path, threads=1)


def spectrum_seeds(folder: Path) -> Iterator[Files]:
    yield {"a.csv": b"wavelength_nm,W/nm\n" + b"".join(b"%d,%f\n" % (nm, nm / 9) for nm in range(380, 781, 20))}
    yield {"a.csv": b"# ours\nnm;relative\n400;0,5\n500;0,7\n700;0,9\n"}
    yield {"a.csv": b"400 0.1\n500 0.2\n600 0.3\n"}


def read_a_spectrum(path: Path) -> object:
    from lidarspectra.spectra.spectrum_files import read_spectrum_file

    found = read_spectrum_file(path)
    assert np.isfinite(found.spectrum.values).all()
    return found


def table_seeds(folder: Path) -> Iterator[Files]:
    yield {"t.csv": (PROJECT / "databases" / "reflectance" / "default-materials.csv").read_bytes()}
    yield {"t.csv": b"id,name,category,provenance,400,410,420\ncc,Orange,painted,measured,0.051,0.052,\nb,B,x,m,,1,2\n"}


def read_a_table(path: Path) -> object:
    from lidarspectra.spectra.spectrum_files import read_table

    return read_table(path)


def manifest_seeds(folder: Path) -> Iterator[Files]:
    yield {"MANIFEST.toml": (PROJECT / "databases" / "MANIFEST.toml").read_bytes()}


def read_a_manifest(path: Path) -> object:
    from lidarspectra.spectra.database_files import read_manifest

    return read_manifest(path.parent, database=None)


def spectraldb_seeds(folder: Path) -> Iterator[Files]:
    head = "ID,Name,ObjectType,RadianceType,Specularity,Roughness,SCIMeasures,SCEMeasures\n"
    rows = (
        '00001,Wall,Wall,Plastic,0.01,0.2,"{360: 8.5, 370: 10.0}","{360: 8.0, 370: 9.0}"\n'
        '00002,Wall,Door,Metal,0,0,"","{400: 50, 700: 60, 705: 70}"\n'
        '7,Bright,Door,Plastic,0,0,"{400: 114.9, 410: 60}",\n'
    )
    yield {"spectraldb.csv": (head + rows).encode()}


def import_spectraldb(path: Path) -> object:
    from lidarspectra.spectra.databases import import_spectraldb

    return import_spectraldb(path)


def lspdd_seeds(folder: Path) -> Iterator[Files]:
    lamp = {
        "id": 2469, "brand": "B", "lamptype": "LED", "category": "LED", "cct": 3000,
        "spectraldata": "wavelength,relativeIntensity\n400,0.1\n401,0.2\n402,0.3\n",
    }  # fmt: skip
    yield {"2469.json": json.dumps(lamp).encode()}


def import_lspdd(path: Path) -> object:
    from lidarspectra.spectra.databases import import_lspdd, user_folder

    (user_folder() / "lamps" / "lspdd.csv").unlink(missing_ok=True)
    return import_lspdd([path])


def ies_seeds(folder: Path) -> Iterator[Files]:
    for phi in ([0.0], [0.0, 45.0, 90.0], [90.0, 180.0, 270.0], [0.0, 120.0, 240.0, 360.0]):
        theta = [0.0, 30.0, 60.0, 90.0]
        rows = "\n".join(" ".join(f"{500 * math.cos(math.radians(t)):.3f}" for t in theta) for _ in phi)
        angles = f"{' '.join(map(str, theta))}\n{' '.join(map(str, phi))}\n{rows}\n"
        yield {
            "a.ies": (
                "IESNA:LM-63-2002\n[TEST] none\n[LUMCAT] TEST 1\nTILT=NONE\n"
                f"1 -1 1.0 {len(theta)} {len(phi)} 1 2 0.3 1.2 0\n1.0 1.0 36\n{angles}"
            ).encode()
        }


def read_an_ies(path: Path) -> object:
    from lidarspectra.lamps.ies import read_ies, read_ies_text

    table = read_ies(read_ies_text(path), where=path.name)
    assert table.luminous_flux_lm() > 0
    return table


def ldt_seeds(folder: Path) -> Iterator[Files]:
    from pyldt import Ldt, LdtHeader, LdtWriter

    planes, angles = np.arange(0.0, 360.0, 90.0), np.arange(0.0, 91.0, 30.0)
    header = LdtHeader(
        company="Ours", ityp=2, isym=0, mc=planes.size, dc=90.0, ng=angles.size, dg=30.0, luminaire_name="One",
        length=1200.0, width=300.0, length_lum_area=1180.0, width_lum_area=280.0, n_sets=1, num_lamps=[1],
        lamp_types=["LED"], lamp_flux=[3000.0], lamp_cct=["4000"], lamp_cri=["80"], lamp_watt=[25.0],
        direct_ratios=[0.0] * 10, c_angles=planes.tolist(), g_angles=angles.tolist(),
    )  # fmt: skip
    values = [[300.0 * math.cos(math.radians(angle)) for angle in angles] for _ in planes]
    LdtWriter.write(Ldt(header=header, intensities=values), folder / "a.ldt")
    yield {"a.ldt": (folder / "a.ldt").read_bytes()}


def read_an_ldt(path: Path) -> object:
    from lidarspectra.lamps.ies import read_ies
    from lidarspectra.lamps.ldt import ies_text_of_ldt

    return read_ies(ies_text_of_ldt(path), where=path.name)


def assignment_seeds(folder: Path) -> Iterator[Files]:
    yield {"a.csv": b"group,name,reflectance,kind,specularity,roughness\n0,Wall,cc-orange,plastic,0,0\n*,,a.csv,,,\n"}
    yield {"a.csv": b"face,reflectance\n0,white-plastic\n1,spectra/wall.csv\n"}


def read_an_assignment(path: Path) -> object:
    from lidarspectra.material.assignments import read_assignments, spectrum_files

    names = spectrum_files(path)
    return read_assignments(path), names


def device_seeds(folder: Path) -> Iterator[Files]:
    yield {"a.csv": b"center_nm,fwhm_nm\n460,20\n560,20\n610,20\n"}
    curves = b"".join(b"%d,%f,%f\n" % (nm, (nm - 400) / 400, (800 - nm) / 400) for nm in range(400, 801, 20))
    yield {"a.csv": b"wavelength_nm,one,two\n" + curves}


def read_a_device(path: Path) -> object:
    from lidarspectra.spectra.sensor_files import find_bands

    return find_bands(path.name, path.parent)


def receptor_seeds(folder: Path) -> Iterator[Files]:
    yield {"a.csv": b"angle_deg,response\n0,1\n20,0.9\n40,0.5\n90,0\n"}


def read_a_receptor(path: Path) -> object:
    from lidarspectra.radiance.sampling.receptors import read_receptor

    return read_receptor(path)


def points_seeds(folder: Path) -> Iterator[Files]:
    yield {"a.csv": b"x,y,z\n1,1,0.5\n2,1,0.5\n"}
    yield {"a.csv": b"name,x,y,z,nx,ny,nz\na,1,1,0.5,0,0,1\nb,2,1,0.5,1,0,0\n"}


def read_some_points(path: Path) -> object:
    from lidarspectra.room.sensor_points import read_points

    return read_points(path)


def cell_seeds(folder: Path) -> Iterator[Files]:
    yield {"a.csv": b"wavelength_nm,quantum efficiency\n400,0.5\n600,0.9\n900,0.8\n1100,0.1\n"}
    yield {"a.csv": b"wavelength_nm,responsivity_A_W\n400,0.2\n600,0.4\n900,0.6\n"}


def read_a_cell(path: Path) -> object:
    from lidarspectra.mapping.photovoltaics.cells import find_cell

    return find_cell(path.name, path.parent)


# --- sensor, robot, maps

LETTERS = "A,B,C,D,E,F,G,H,R,I,S,J,T,U,V,W,K,L"
NUMBERS = ",".join(str(10 + i) for i in range(18))


def log_seeds(folder: Path) -> Iterator[Files]:
    import gzip

    sketch = f"AS7265x Spectral Triad Example\r\n{LETTERS}\r\n" + f"{NUMBERS},\r\n" * 5
    yield {"log.txt": sketch.encode()}
    yield {"log.txt": gzip.compress(sketch.encode())}
    stamped = "".join(f"14:36:08.{i:03d} -> {NUMBERS}\n" for i in range(5))
    yield {"log.txt": f"{LETTERS}\n{stamped}".encode()}
    from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS

    head = "time,x,y,z,gain,integration_ms," + ",".join(f"{label}nm" for label in CHANNEL_LABELS)
    yield {"log.csv": f"{head}\n2023-04-20T14:36:08Z,1,2,3,16,165.2,{NUMBERS}\n".encode()}
    yield {"log.csv": own_log(folder)}


def own_log(folder: Path) -> bytes:
    """A log as `sensor record` writes it."""
    from lidarspectra.hardware.sensor.reading_log import LogWriter
    from lidarspectra.hardware.sensor.sensor_records import Moment, Note, Reading

    path = folder / "own.csv"
    with LogWriter(path) as writer:
        writer.head(["protocol = test"])
        for number in range(3):
            moment = Moment(unix_s=1.7e9 + number, monotonic_s=float(number))
            reading = Reading(
                moment=moment, counts=np.arange(18.0), module_values=np.full(18, np.nan),
                flags=np.zeros(18, dtype=np.uint8), gain=16.0, integration_ms=165.2,
                temperatures_c=(25.0, 25.0, 25.0), boot=1, sequence=number, device_ms=1000 * number,
            )  # fmt: skip
            writer.write([reading, Note(moment=moment, text="one line")], moment)
    return path.read_bytes()


def read_a_log(path: Path) -> object:
    from lidarspectra.hardware.sensor.log_layouts import read_sensor_log

    return read_sensor_log(path)


def stream_seeds(folder: Path) -> Iterator[Files]:
    from lidarspectra.hardware.sensor.line_frames import frame

    sketch = f"AS7265x Spectral Triad Example\r\n{LETTERS}\r\n" + f"{NUMBERS},\r\n" * 5
    yield {"sketch": sketch.encode()}
    yield {"at": b"OK\r\n" + b"1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18 OK\r\nERROR\r\n" * 4}
    channels = ",".join(f"{letter}:count" for letter in LETTERS.split(","))
    bodies = [f"H,1,as7265x,3,S,gain:1,integration:ms,{channels}"]
    bodies += [f"D,3,S,{number},{1000 * number},16,165.2,{NUMBERS}" for number in range(3)]
    yield {"lines": b"".join(map(frame, bodies))}


def change_frames(data: bytes, rng: m.Generator) -> bytes:
    """Change the words in frames, with check sums that fit."""
    from lidarspectra.hardware.sensor.line_frames import checksum, frames_in

    bodies = [m.text(body.encode(), rng) if rng.random() < 0.3 else body.encode() for body in frames_in(data)]
    return b"".join(b"$%s*%04X\r\n" % (body, checksum(body)) for body in bodies) or m.raw(data, rng)


def read_a_stream(path: Path) -> object:
    """Three drivers and the one that recognises them take the bytes in pieces; time passes between."""
    from lidarspectra.hardware.sensor.as7265x import ASCENDING_ORDER, SensorSettings
    from lidarspectra.hardware.sensor.at_firmware import AtDriver
    from lidarspectra.hardware.sensor.line_protocol import LineProtocolDriver
    from lidarspectra.hardware.sensor.sensor_records import Moment
    from lidarspectra.hardware.sensor.sketch_text import SketchTextDriver

    data = path.read_bytes()
    settings = SensorSettings(gain_code=3, integration_steps=50)
    drivers = (
        AtDriver(settings=settings, period_s=1.0),
        LineProtocolDriver(settings=settings, period_s=1.0),
        SketchTextDriver(order=ASCENDING_ORDER, period_s=1.0, settings=None),
    )
    for driver in drivers:
        moment = Moment(unix_s=1.7e9, monotonic_s=0.0)
        driver.connect(moment)
        for start in range(0, len(data), 37):
            moment = moment.earlier(-0.3)
            driver.receive(data[start : start + 37], moment)
            driver.tick(moment)
            assert len(driver.outgoing()) < 10_000
        driver.finish(moment)
        list(driver.describe())
    return drivers


def pose_seeds(folder: Path) -> Iterator[Files]:
    rows = [(1.7e9 + i, 0.1 * i, 0.2 * i, 0.0, 0.1 * i) for i in range(4)]
    lines = "".join(f"{t},{x},{y},{z},{a}\n" for t, x, y, z, a in rows)
    yield {"a.csv": ("Time,X,Y,Z,yaw_deg\n" + lines).encode()}
    yield {
        "a.csv": (
            "# odometry\nstamp,x,y,z,qx,qy,qz,qw\n" + "".join(f"{r[0]},{r[1]},1,0,0,0,0,1\n" for r in rows)
        ).encode()
    }
    message = (
        "header:\n  stamp:\n    sec: {}\n    nanosec: 5\n  frame_id: odom\npose:\n  pose:\n    position:\n"
        "      x: {}\n      y: 1.0\n      z: 0.0\n    orientation:\n      x: 0.0\n      y: 0.0\n      z: 0.0\n"
        "      w: 1.0\n---\n"
    )
    yield {"a.txt": "".join(message.format(1_700_000_000 + i, 0.1 * i) for i in range(3)).encode()}


def read_some_poses(path: Path) -> object:
    from lidarspectra.hardware.robot.poses import read_poses

    return read_poses(path)


def measured_seeds(folder: Path) -> Iterator[Files]:
    yield {"m.csv": b"# joined\nx,y,z,E_410,SE_410,E_435\n1,1,0.3,0.01,0.001,0.02\n2,1,0.3,0.02,0.001,0.03\n"}


def read_a_measured_table(path: Path) -> object:
    from lidarspectra.hardware.sensor.measured_readings import channel_columns, read_readings

    table = read_readings(path)
    return channel_columns(table, ("410", "435"), "W/m2/nm")


def calibration_seeds(folder: Path) -> Iterator[Files]:
    from lidarspectra.hardware.sensor.calibration import Calibration
    from lidarspectra.hardware.sensor.calibration_files import calibration_text

    ones = np.ones(18)
    calibration = Calibration(
        name="mine", device="AS7265x", kind="lamp", signal="basic", gain=16.0, integration_ms=165.2,
        responsivity=ones, responsivity_se=0.1 * ones, dark=0 * ones, dark_se=0 * ones,
        is_measured=np.ones(18, dtype=np.bool_), die_factor=np.ones(3), die_factor_se=np.full(3, 0.1), residual=0.01,
        observations=("a",), version=1, created="2024-05-13T00:00:00+00:00",
    )  # fmt: skip
    yield {"v0001.json": calibration_text(calibration).encode()}


def read_a_calibration(path: Path) -> object:
    from lidarspectra.hardware.sensor.calibration_files import read_calibration

    return read_calibration(path)


POINTS = 4


def coordinates() -> dict[str, object]:
    """Coordinates of a transport: two lamps, four points, 14 bands."""
    from lidarspectra.spectra.spectrum import sensor_bands

    bands = sensor_bands("as7265x-14")
    places = {name: ("point", np.arange(POINTS, dtype=float), {"units": "m"}) for name in ("x", "y", "z")}
    normals = {name: ("point", np.full(POINTS, float(name == "nz")), {"units": "1"}) for name in ("nx", "ny", "nz")}
    return {
        **places, **normals,
        "lamp": ("lamp", ["one", "two"]),
        "buried": ("point", np.zeros(POINTS, dtype=np.bool_)),
        "band": ("band", bands.centers_nm, {"units": "nm"}),
        "band_width": ("band", bands.widths_nm, {"units": "nm"}),
        "band_label": ("band", list(bands.labels)),
    }  # fmt: skip


def hand_made_transport() -> "object":
    """A transport that was not traced."""
    import xarray as xr

    from lidarspectra.radiance.sampling.transport import SCHEMA

    where = coordinates()
    count = len(where["band"][1])
    cube = ("lamp", "point", "band")
    variables = {
        "coefficient": (cube, np.full((2, POINTS, count), 0.01), {"units": "m-2"}),
        "coefficient_se": (cube, np.full((2, POINTS, count), 1e-4), {"units": "m-2"}),
        "flux": (("lamp", "band"), np.ones((2, count)), {"units": "W nm-1"}),
        "irradiance_se": (("point", "band"), np.full((POINTS, count), 1e-4), {"units": "W m-2 nm-1"}),
        "coefficient_batches": (("batch", *cube), np.full((8, 2, POINTS, count), 0.01), {"units": "m-2"}),
    }
    return xr.Dataset(variables, where, {"schema": SCHEMA, "accuracy": "low", "noise": "draft"})


def transport_seeds(folder: Path) -> Iterator[Files]:
    from lidarspectra.radiance.sampling.transport import save_transport

    save_transport(hand_made_transport(), folder / "transport.nc")
    yield {"transport.nc": (folder / "transport.nc").read_bytes()}


def read_a_transport(path: Path) -> object:
    from lidarspectra.mapping.maps.spectral_map import spectral_map
    from lidarspectra.radiance.sampling.transport import load_transport

    return spectral_map(load_transport(path))


def map_seeds(folder: Path) -> Iterator[Files]:
    from lidarspectra.mapping.maps.map_files import save_map
    from lidarspectra.mapping.maps.spectral_map import spectral_map

    save_map(spectral_map(hand_made_transport()), folder / "map.nc")
    yield {"map.nc": (folder / "map.nc").read_bytes()}


def read_a_map(path: Path) -> object:
    from lidarspectra.mapping.maps.map_files import load_map

    return load_map(path)


def map_table_seeds(folder: Path) -> Iterator[Files]:
    from lidarspectra.mapping.maps.map_files import save_map_table
    from lidarspectra.mapping.maps.spectral_map import spectral_map

    save_map_table(spectral_map(hand_made_transport()), folder / "map.csv")
    yield {"map.csv": (folder / "map.csv").read_bytes()}


def read_a_map_table(path: Path) -> object:
    from lidarspectra.hardware.robot.reference_files import read_map
    from lidarspectra.mapping.maps.map_files import read_map_table
    from lidarspectra.spectra.spectrum import sensor_bands

    read_map(path)
    return read_map_table(path, bands=sensor_bands("as7265x-14"))


def change_netcdf(data: bytes, rng: m.Generator) -> bytes:
    """Change a dataset or attribute of an HDF5 file by its own library: type, shape, numbers, presence."""
    import h5py

    stream = io.BytesIO(data)
    try:
        with h5py.File(stream, "r+") as file:
            name = m.one_of(sorted(file), rng)
            item = file[name]
            kind = int(rng.integers(6))
            if kind == 0:
                del file[name]
            elif kind == 1 and len(item.attrs):
                del item.attrs[m.one_of(sorted(item.attrs), rng)]
            elif kind == 2:
                owner = file if rng.random() < 0.5 else item
                key = m.one_of([*owner.attrs, "units"], rng)
                owner.attrs[key] = m.one_of(("", "x" * 10_000, "K", 3.0, np.array([1, 2]), np.nan, b"\xff\xfe"), rng)
            elif kind == 3 and item.dtype.kind == "f":
                item[...] = m.one_of((np.nan, np.inf, -1.0, 1e308, 0.0), rng)
            elif kind == 4 and item.dtype.kind == "f" and item.size:
                item[(int(rng.integers(item.shape[0])), ...)] = m.one_of((np.nan, -np.inf, -1e9, 1e308), rng)
            else:
                del file[name]
                file[name] = m.one_of((np.zeros(3), np.zeros((2, 2)), "words", 7, np.zeros(0), np.arange(14)), rng)
    except (
        OSError,
        KeyError,
        ValueError,
        RuntimeError,
        TypeError,
        AttributeError,
    ):  # a second change of a damaged file
        return m.raw(data, rng)
    return stream.getvalue()


TEXT = (m.text,)
NETCDF = (m.any_of(change_netcdf, change_netcdf, m.raw),)
JSON = (m.any_of(m.change_json, m.change_json, m.change_json, m.text, m.nest_json),)

READERS = (
    Reader(name="glb", seeds=glb_seeds, read=read_a_scan, damage=(m.change_glb, m.change_glb, m.raw)),
    Reader(name="gltf", seeds=gltf_seeds, read=read_a_scan, damage=JSON),
    Reader(name="obj", seeds=obj_seeds, read=read_a_scan, damage=TEXT),
    Reader(name="mtl", seeds=mtl_seeds, read=read_a_scan, damage=TEXT),
    Reader(name="ply", seeds=ply_seeds, read=read_a_scan, damage=(m.text, m.raw)),
    Reader(name="stl", seeds=stl_seeds, read=read_a_scan, damage=(m.text, m.raw)),
    Reader(
        name="usd",
        seeds=usd_seeds,
        read=read_a_scan,
        damage=(m.change_zip, m.raw, m.text),
        cases_a_process=1_000,  # USD's library loses some 2 MB with every damaged file, and says so nowhere
    ),
    Reader(name="capture", seeds=capture_seeds, read=read_a_capture, damage=(m.change_zip, m.change_zip, m.raw)),
    Reader(
        name="room",
        seeds=room_seeds,
        read=read_a_room,
        damage=(rooms.another_room,),
        cases_a_process=50,
        most_cases=300,
        case_s=300.0,
        starts_programs=True,
    ),
    Reader(name="texture", seeds=texture_seeds, read=read_a_texture, damage=(damage_a_texture,)),
    Reader(name="run file", seeds=run_file_seeds, read=read_a_run_file, damage=TEXT),
    Reader(name="room plan", seeds=plan_seeds, read=read_a_plan, damage=TEXT),
    Reader(name="model card", seeds=card_seeds, read=read_a_card, damage=TEXT),
    Reader(name="model", seeds=model_seeds, read=read_a_model, damage=(m.raw,)),
    Reader(name="spectrum", seeds=spectrum_seeds, read=read_a_spectrum, damage=TEXT),
    Reader(name="spectra table", seeds=table_seeds, read=read_a_table, damage=TEXT),
    Reader(name="manifest", seeds=manifest_seeds, read=read_a_manifest, damage=TEXT),
    Reader(name="spectraldb import", seeds=spectraldb_seeds, read=import_spectraldb, damage=TEXT),
    Reader(name="lspdd import", seeds=lspdd_seeds, read=import_lspdd, damage=JSON),
    Reader(name="ies", seeds=ies_seeds, read=read_an_ies, damage=TEXT),
    Reader(name="ldt", seeds=ldt_seeds, read=read_an_ldt, damage=TEXT),
    Reader(name="assignments", seeds=assignment_seeds, read=read_an_assignment, damage=TEXT),
    Reader(name="sensor device", seeds=device_seeds, read=read_a_device, damage=TEXT),
    Reader(name="receptor", seeds=receptor_seeds, read=read_a_receptor, damage=TEXT),
    Reader(name="sensor points", seeds=points_seeds, read=read_some_points, damage=TEXT),
    Reader(name="solar cell", seeds=cell_seeds, read=read_a_cell, damage=TEXT),
    Reader(name="sensor log", seeds=log_seeds, read=read_a_log, damage=TEXT),
    Reader(name="serial stream", seeds=stream_seeds, read=read_a_stream, damage=(m.text, m.raw, change_frames)),
    Reader(name="robot poses", seeds=pose_seeds, read=read_some_poses, damage=TEXT),
    Reader(name="measured table", seeds=measured_seeds, read=read_a_measured_table, damage=TEXT),
    Reader(name="calibration", seeds=calibration_seeds, read=read_a_calibration, damage=JSON),
    Reader(name="transport", seeds=transport_seeds, read=read_a_transport, damage=NETCDF),
    Reader(name="map", seeds=map_seeds, read=read_a_map, damage=NETCDF),
    Reader(name="map table", seeds=map_table_seeds, read=read_a_map_table, damage=TEXT),
)
"""In the order of a run."""
