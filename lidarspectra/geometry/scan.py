"""The scan: the phone's triangle mesh of the room, in metres with z up, with its colour."""

import json
import zipfile
import zlib
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray, float_array, int_array
from lidarspectra.errors import ArrayError, LidarSpectraError, ScanError
from lidarspectra.geometry.appearance import Appearance as Appearance
from lidarspectra.geometry.appearance import LinearLight
from lidarspectra.geometry.textures import TextureArray, decode_image
from lidarspectra.geometry.triangles import triangle_crosses
from lidarspectra.io.files import writing
from lidarspectra.io.png_files import write_png

MESH_FILE = "mesh.npz"
RECORD_FILE = "scan.json"
_FORMAT_VERSION = 1
_MAX_HALF = 65504.0  # [1] largest 16-bit float
_DAMAGE = (
    OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, zlib.error, LidarSpectraError,
)  # fmt: skip  # what a damaged JSON, NPZ or PNG makes its reader raise
_ARRAYS = ("vertices", "faces", "face_image", "corner_uv", "corner_color")
_PART_ARRAYS = ("color_source", "face_kind")  # not in the folders of earlier versions
_LINEAR_ARRAYS = ("face_deviation", "face_cut")  # of colours from frames
_OF_FACES = ("centers", "areas", "normals")  # that a scan works out of its mesh


@dataclass(frozen=True, kw_only=True)
class ScanRecord:
    """What was found in the scan's file and how it was repaired; every change is counted here.

    Parameters
    ----------
    file : str
        Name of the file (no folder).
    unit : str
        Unit of the file's coordinates ('m', 'cm', 'mm', 'in', 'ft').
    unit_confidence, up_confidence : float
        Probability of the detected unit and axis; 1 where the user gave it. [0-1]
    up_axis : str
        The file's upward axis ('+x', '-x', ... '+z').
    faces_read, faces_kept : int
        Triangles in the file, and after repair.
    duplicate_faces, degenerate_faces : int
        Triangles removed for either reason.
    holes_closed : int
        Boundary loops that were closed.
    hole_area_m2, area_m2 : float
        Area added in closing them, and of the whole mesh after repair. [m²]
    holes_open : int
        Boundary loops that were left open: too large, or not to be closed.
    longest_open_hole_m : float
        Longest extent among those; 0 where there are none. [m]
    merged_vertices : int
        Vertices that coincided with another one.
    flipped_faces : int
        Triangles whose normal was turned towards the room.
    hidden_faces : int
        Triangles of layers that nobody in the room can see, which were left out.
    hidden_area_m2 : float
        Their area. [m²]
    cut_faces : int
        Triangles cut off at glass and mirrors: in the pane, bulges behind it, and what it mirrors.
    cut_area_m2 : float
        Their area. [m²]
    decimated_from : int
        Triangles before decimation; 0 where none was asked for.
    flat_planes : int
        Planes that were found and made flat.
    flat_area_share : float
        Share of the area that lies on them. [0-1]
    moved_vertex_share : float
        Share of the vertices that were moved for that. [0-1]
    moved_rms_m : float
        Root mean square of how far. [m]
    open_share : float
        Share of the directions that the room's free space looks in that leave the scan, after closing. [0-1]
    closed_area_m2 : float
        Area of ceiling, floor and sides that were not scanned and were closed. [m²]
    notes : tuple of str
        What the user should know, as full sentences.
    """

    file: str
    unit: str
    unit_confidence: float
    up_axis: str
    up_confidence: float
    faces_read: int
    faces_kept: int
    duplicate_faces: int = 0
    degenerate_faces: int = 0
    holes_closed: int = 0
    hole_area_m2: float = 0.0
    area_m2: float = 0.0
    holes_open: int = 0
    longest_open_hole_m: float = 0.0
    merged_vertices: int = 0
    flipped_faces: int = 0
    hidden_faces: int = 0
    hidden_area_m2: float = 0.0
    cut_faces: int = 0
    cut_area_m2: float = 0.0
    decimated_from: int = 0
    flat_planes: int = 0
    flat_area_share: float = 0.0
    moved_vertex_share: float = 0.0
    moved_rms_m: float = 0.0
    open_share: float = 0.0
    closed_area_m2: float = 0.0
    notes: tuple[str, ...] = ()

    @property
    def hole_share(self) -> float:
        """Share of the mesh's area that was closed holes [0-1]."""
        return self.hole_area_m2 / self.area_m2 if self.area_m2 > 0 else 0.0


class Mesh:
    """Stands for the coloured triangles of scans that share them; what is made of these once is kept as long as it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scan:
    """A room as a coloured triangle mesh.

    Parameters
    ----------
    vertices : (vertex, 3) float
        Positions, z up. [m]
    faces : (face, 3) int
        Corners, counter-clockwise seen from inside the room.
    appearance : Appearance
        Colour of every face.
    record : ScanRecord
        Provenance and repairs.
    """

    vertices: FloatArray
    faces: IntArray
    appearance: Appearance
    record: ScanRecord

    def __post_init__(self) -> None:
        vertices = float_array(self.vertices, name="Scan.vertices", shape=(None, 3))
        faces = int_array(self.faces, name="Scan.faces", shape=(None, 3))
        if faces.shape[0] == 0:
            raise ArrayError(expected="at least one triangle", found="none", where="Scan.faces")
        if faces.min() < 0 or faces.max() >= vertices.shape[0]:
            raise ArrayError(
                expected=f"corner numbers from 0 to {vertices.shape[0] - 1}",
                found=f"{faces.min()} to {faces.max()}",
                where="Scan.faces",
            )
        if self.appearance.face_image.size != faces.shape[0]:
            raise ArrayError(
                expected=f"an appearance for {faces.shape[0]} faces",
                found=f"one for {self.appearance.face_image.size}",
                where="Scan.appearance",
            )
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    def __repr__(self) -> str:
        low, high = self.bounds
        size = " x ".join(f"{side:.2f}" for side in high - low)
        color = "coloured" if self.appearance.known else "without colour"
        name = f" '{self.record.file}'" if self.record.file else ""
        return f"<Scan{name}: {len(self.faces)} triangles, {size} m, {color}>"

    @property
    def corners(self) -> FloatArray:
        """(face, 3, 3) positions of each face's corners [m]."""
        return np.asarray(self.vertices[self.faces], dtype=np.float64)

    @cached_property
    def centers(self) -> FloatArray:
        """(face, 3) centroids [m]; worked out once, and read-only, as all below."""
        return _read_only(self.corners.mean(axis=1))

    @cached_property
    def areas(self) -> FloatArray:
        """(face,) areas [m²]."""
        return _read_only(0.5 * np.linalg.norm(self._crosses, axis=1))

    @cached_property
    def normals(self) -> FloatArray:
        """(face, 3) unit normals [1]; zero for a face without area."""
        lengths = np.linalg.norm(self._crosses, axis=1, keepdims=True)
        return _read_only(self._crosses / np.where(lengths > 0, lengths, 1.0))

    @cached_property
    def _crosses(self) -> FloatArray:
        """(face, 3) vectors along the normals, twice the areas long [m²]."""
        return triangle_crosses(self.corners)

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3) lowest and highest corner of the box around the mesh [m]."""
        used = np.zeros(len(self.vertices), dtype=np.bool_)
        used[self.faces] = True
        places = self.vertices[used]
        return _read_only(np.stack([places.min(axis=0), places.max(axis=0)]))

    @cached_property
    def _mesh(self) -> Mesh:
        return Mesh()

    def face_colors(self) -> FloatArray:
        """(face, 3) mean linear sRGB [0-1] of each face; worked out once."""
        return self.appearance.face_colors()


def _read_only(values: FloatArray) -> FloatArray:
    values.flags.writeable = False
    return values


def mesh_of(scan: Scan) -> Mesh:
    """What stands for a scan's coloured triangles: the same for scans that differ in their records alone."""
    return scan._mesh


def some_faces(scan: Scan, faces: IntArray, *, record: ScanRecord | None = None) -> Scan:
    """Some faces of a scan, with all of its vertices; what was worked out of each face is kept.

    Parameters
    ----------
    scan : Scan
    faces : (n,) int
        In the order that they shall have.
    record : ScanRecord, optional
        Another one.

    Returns
    -------
    chosen : Scan
    """
    known = scan.__dict__  # where `cached_property` keeps what was worked out
    chosen = replace(
        scan, faces=scan.faces[faces], appearance=scan.appearance.select(faces), record=record or scan.record
    )
    chosen.__dict__.update({name: _read_only(known[name][faces]) for name in _OF_FACES if name in known})
    return chosen


def with_record(scan: Scan, record: ScanRecord) -> Scan:
    """The same triangles with another record; what was worked out of them is kept.

    Parameters
    ----------
    scan : Scan
    record : ScanRecord

    Returns
    -------
    scan : Scan
    """
    known = scan.__dict__ | {"_mesh": scan._mesh}
    other = replace(scan, record=record)
    other.__dict__.update({name: known[name] for name in (*_OF_FACES, "bounds", "_mesh") if name in known})
    return other


def bare_scan(vertices: FloatArray, faces: IntArray, *, file: str = "") -> Scan:
    """A scan without colour of a bare mesh, for ray casting and for scenes.

    Parameters
    ----------
    vertices : (vertex, 3) float
        [m]
    faces : (face, 3) int
        Corners, counter-clockwise seen from the air.
    file : str
        Where the mesh is from, if from a file.

    Returns
    -------
    scan : Scan
        Its appearance is marked as not known.

    Raises
    ------
    ArrayError
        If there is no triangle, or a corner that is no vertex.
    """
    count = len(faces)
    return Scan(
        vertices=vertices,
        faces=faces,
        appearance=Appearance(
            images=(),
            face_image=np.full(count, -1),
            corner_uv=np.zeros((count, 3, 2)),
            corner_color=np.full((count, 3, 3), 0.5),
            known=False,
        ),
        record=ScanRecord(
            file=file,
            unit="m",
            unit_confidence=1.0,
            up_axis="+z",
            up_confidence=1.0,
            faces_read=count,
            faces_kept=count,
        ),
    )


def save_scan(scan: Scan, folder: Path) -> None:
    """Write a scan to a folder: arrays as NPZ, textures as PNG, the record as JSON.

    Parameters
    ----------
    scan : Scan
        What to write.
    folder : Path
        Created if missing; files of an earlier scan in it are replaced.

    Raises
    ------
    ScanError
        If the folder cannot be written.
    """
    appearance = scan.appearance
    about = {
        "format": _FORMAT_VERSION,
        "images": len(appearance.images),
        "faces": int(scan.faces.shape[0]),
        "color_known": appearance.known,
        "bounds_m": scan.bounds.tolist(),
        "kinds": appearance.kinds,
        "linear": None
        if (linear := appearance.linear) is None
        else {"power_deviation": linear.power_deviation, "shoulder_deviation": linear.shoulder_deviation},
        "record": asdict(scan.record),
    }
    with writing(folder, error=ScanError):
        folder.mkdir(parents=True, exist_ok=True)
        np.savez(
            folder / MESH_FILE,
            allow_pickle=False,
            vertices=scan.vertices,
            faces=scan.faces,
            face_image=appearance.face_image,
            corner_uv=appearance.corner_uv,
            corner_color=appearance.corner_color,
            color_source=appearance.sources,
            face_kind=appearance.face_kinds,
            **({} if linear is None else {name: getattr(linear, name) for name in _LINEAR_ARRAYS}),
        )
        for number, image in enumerate(appearance.images):
            if image.dtype == np.uint8:
                write_png(_texture_path(folder, number), np.asarray(image, dtype=np.uint8))
            else:  # of 11 bits, finer than any frame's 8
                np.save(_radiance_path(folder, number), np.minimum(image, _MAX_HALF).astype(np.float16))
        (folder / RECORD_FILE).write_text(json.dumps(about, indent=2, ensure_ascii=False), encoding="utf-8")


def load_scan(folder: Path) -> Scan:
    """Read a scan that `save_scan` wrote.

    Parameters
    ----------
    folder : Path
        The folder.

    Returns
    -------
    scan : Scan

    Raises
    ------
    ScanError
        If a file is missing, damaged, or does not fit the others.
    """
    try:
        about = json.loads((folder / RECORD_FILE).read_text(encoding="utf-8"))
        if about["format"] != _FORMAT_VERSION:
            raise ValueError(f"format {about['format']} in place of {_FORMAT_VERSION}")
        known = {item.name for item in fields(ScanRecord)}
        record = ScanRecord(**{name: value for name, value in about["record"].items() if name in known})
        # Opened here: numpy leaves a file open that turns out to be no archive.
        with (folder / MESH_FILE).open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            vertices, faces, face_image, corner_uv, corner_color = (arrays[name] for name in _ARRAYS)
            parts = {name: arrays[name] for name in _PART_ARRAYS if name in arrays}
            said = about.get("linear")
            linear = None if said is None else LinearLight(**said, **{name: arrays[name] for name in _LINEAR_ARRAYS})
        if faces.shape[0] != about["faces"]:
            raise ValueError(f"{faces.shape[0]} faces in place of {about['faces']}")
        load = _load_texture if linear is None else _load_radiance
        images = tuple(load(folder, number) for number in range(about["images"]))
        return Scan(
            vertices=vertices,
            faces=faces,
            appearance=Appearance(
                images=images,
                face_image=face_image,
                corner_uv=corner_uv,
                corner_color=corner_color,
                known=bool(about["color_known"]),
                kinds=tuple(about.get("kinds", ())),
                linear=linear,
                **parts,
            ),
            record=_with_tuples(record),
        )
    except _DAMAGE as cause:
        raise ScanError(
            expected="a scan as it was saved",
            found=f"one that cannot be read ({type(cause).__name__}: {cause})",
            where=str(folder),
            todo="Run the scan stage again.",
        ) from cause


def load_bounds(folder: Path) -> FloatArray:
    """Box around a scan that `save_scan` wrote, without reading its mesh.

    Parameters
    ----------
    folder : Path
        The folder.

    Returns
    -------
    bounds : (2, 3) float
        Lowest and highest corner. [m]

    Raises
    ------
    ScanError
        If its record is missing or damaged.
    """
    try:
        about = json.loads((folder / RECORD_FILE).read_text(encoding="utf-8"))
        if "bounds_m" in about:
            return float_array(about["bounds_m"], name="bounds_m", shape=(2, 3))
    except (*_DAMAGE, AttributeError) as cause:
        raise ScanError(
            expected="the record of a scan as it was saved",
            found=f"one that cannot be read ({type(cause).__name__}: {cause})",
            where=str(folder),
            todo="Run the scan stage again.",
        ) from cause
    return load_scan(folder).bounds  # of a run by an earlier version, whose record has no box


def _texture_path(folder: Path, number: int) -> Path:
    return folder / f"texture{number}.png"


def _load_texture(folder: Path, number: int) -> TextureArray:
    path = _texture_path(folder, number)
    return decode_image(path.read_bytes(), name=str(path))


def _radiance_path(folder: Path, number: int) -> Path:
    return folder / f"radiance{number}.npy"


def _load_radiance(folder: Path, number: int) -> TextureArray:
    return np.asarray(np.load(_radiance_path(folder, number), allow_pickle=False), dtype=np.float32)


def _with_tuples(record: ScanRecord) -> ScanRecord:
    """Turn JSON's lists into tuples."""
    return replace(record, notes=tuple(record.notes))
