"""Is a run still what its record says: every input, database and result, by its SHA-256.

A run folder tells of itself: `lidarspectra-run.json` has the run file's text, each `stage.json` the hashes of what the
stage was made from and of what it made. Here they are held against the files as they are now. All names in a run are
relative, so that a run may have moved; where it moved without its inputs, those are not compared, and that is said.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from lidarspectra.errors import WorkspaceError
from lidarspectra.io.files import hash_file
from lidarspectra.material.segmentation.segmentation import SHIPPED_MODEL
from lidarspectra.spectra.databases import list_databases
from lidarspectra.workflow.run_folder.workspace import (
    RECORD_FILE,
    STAGES,
    RunRequest,
    StageName,
    StageRecord,
    hash_files,
    parse_record,
    read_request,
    record_key,
    stage_folder,
    versions,
)

Part = Literal["input", "database", "result", "record"]
State = Literal["same", "changed", "missing", "added"]
OLD_SOURCES: dict[StageName, dict[str, StageName]] = {
    "scan": {},
    "views": {"scan": "scan"},
    "materials": {"scan": "scan", "views": "views"},
    "scene": {"scan": "scan", "materials": "materials"},
    "trace": {"scan": "scan", "scene": "scene"},
    "map": {"transport": "trace"},
    "report": {},  # names its stages in a table of their own
}
"""Where earlier packages kept the contents of the stages before a stage; now they stand under "stages"."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One file, or one record, and how it compares.

    Parameters
    ----------
    part : 'input', 'database', 'result' or 'record'
        What it is to the run.
    stage : str
        The stage that names it.
    name : str
        As the record has it.
    state : 'same', 'changed', 'missing' or 'added'
        'added' is a file in a stage's folder that the stage did not make.
    words : str
        What is more to say.
    """

    part: Part
    stage: StageName
    name: str
    state: State
    words: str = ""

    def __str__(self) -> str:
        place = f"{stage_folder(Path(), self.stage)}/{self.name}" if self.part in ("result", "record") else self.name
        said = {
            "same": "as recorded",
            "changed": "another content than recorded",
            "missing": "not there",
            "added": "not made by the stage",
        }
        return f"{self.part} {place}: {self.words or said[self.state]}"


@dataclass(frozen=True, kw_only=True)
class Verification:
    """What was found in a run.

    Parameters
    ----------
    run : Path
    findings : tuple of Finding
        One a file.
    finished, unfinished : tuple of str
        Stages that are there, and those that are not.
    notes : tuple of str
        What was not compared, and other versions than the run's.
    """

    run: Path
    findings: tuple[Finding, ...]
    finished: tuple[StageName, ...]
    unfinished: tuple[StageName, ...]
    notes: tuple[str, ...]

    @property
    def differences(self) -> tuple[Finding, ...]:
        """Findings that are not as recorded."""
        return tuple(finding for finding in self.findings if finding.state != "same")

    def lines(self) -> Iterator[str]:
        """What was compared, in words: how many files of each part are as recorded."""
        for part, title in (("input", "inputs"), ("database", "databases"), ("result", "results")):
            found = [finding.state for finding in self.findings if finding.part == part]
            yield f"{title:<10} {found.count('same')} of {len(found)} files as recorded"
        whole = "all stages" if not self.unfinished else ", ".join(self.finished) or "none"
        missing = f"; not made: {', '.join(self.unfinished)}" if self.unfinished else ""
        yield f"{'stages':<10} {whole}{missing}"


def verify_run(run: Path, *, inputs: Path | None = None) -> Verification:
    """Compare every file that a run's record names with what the record says of it.

    Parameters
    ----------
    run : Path
        A run folder; it may have moved, or be cut short.
    inputs : Path, optional
        Folder of the run file; where the run was made beside it, it is found.

    Returns
    -------
    verification : Verification

    Raises
    ------
    WorkspaceError
        If the folder is no run, or a file in it cannot be read.
    """
    request = read_request(run)
    records = {stage: parse_record(stage_folder(run, stage)) for stage in STAGES}
    base, notes = _inputs_folder(run, request, inputs)
    findings: list[Finding] = []
    if base is not None and request is not None:
        findings.append(_compared("input", "scan", request.name, request.sha256, base / request.name))
    databases = {f"{file.database}/{file.path.name}": file.path for file in list_databases()}
    contents: dict[StageName, dict[str, str]] = {}
    try:
        for stage, record in records.items():
            folder = stage_folder(run, stage)
            if record is None:
                if folder.is_dir():
                    findings.append(_record(stage, "changed", "it cannot be read"))
                continue
            contents[stage] = hash_files(folder)
            findings += _results(record, stage, contents[stage])
            if record.key != record_key(record):
                findings.append(_record(stage, "changed", "its key is not that of its settings"))
                continue
            findings += _sources(record, stage, records, contents)
            findings += _databases(record, stage, databases)
            if base is not None:
                findings += _inputs(record, stage, base)
    except OSError as cause:
        raise WorkspaceError(
            expected="a run folder and inputs that can be read",
            found=str(cause.strerror or cause),
            where=str(cause.filename or run),
            todo="Check their permissions.",
        ) from cause
    return Verification(
        run=run,
        findings=tuple(dict.fromkeys(_without_relit(findings))),
        finished=tuple(stage for stage in STAGES if records[stage] is not None),
        unfinished=tuple(stage for stage in STAGES if records[stage] is None),
        notes=(*notes, *_version_notes(records)),
    )


def _without_relit(findings: Sequence[Finding]) -> Iterator[Finding]:
    """Findings without lamps' spectra that changed after the scene was made, and that its map was made with again."""
    known_to_map = {(each.part, each.name) for each in findings if each.stage == "map" and each.state == "same"}
    for finding in findings:
        is_relit = finding.stage == "scene" and finding.part in ("input", "database") and finding.state == "changed"
        if not (is_relit and (finding.part, finding.name) in known_to_map):
            yield finding


def _inputs_folder(run: Path, request: RunRequest | None, given: Path | None) -> tuple[Path | None, tuple[str, ...]]:
    """Where the run file and what it names lie, or None with the reason."""
    if request is None:
        return None, ("The inputs were not compared, since the run has no record of its run file.",)
    folder = given if given is not None else Path(os.path.normpath(run.resolve() / request.folder))
    if given is None and not (folder / request.name).is_file():
        return None, (
            f"The inputs were not compared, since {request.name} is not beside the run. Name its folder with --inputs.",
        )
    return folder, ()


def _compared(part: Part, stage: StageName, name: str, recorded: str, path: Path) -> Finding:
    state: State = "missing"
    if path.is_file():
        state = "same" if hash_file(path) == recorded else "changed"
    return Finding(part=part, stage=stage, name=name, state=state)


def _record(stage: StageName, state: State, words: str) -> Finding:
    return Finding(part="record", stage=stage, name=RECORD_FILE, state=state, words=words)


def _results(record: StageRecord, stage: StageName, found: Mapping[str, str]) -> Iterator[Finding]:
    """The stage's own files."""
    for name, recorded in record.outputs.items():
        state: State = "missing" if name not in found else "same" if found[name] == recorded else "changed"
        yield Finding(part="result", stage=stage, name=name, state=state)
    for name in sorted(found.keys() - record.outputs.keys()):
        yield Finding(part="result", stage=stage, name=name, state="added")


def _sources(
    record: StageRecord,
    stage: StageName,
    records: Mapping[StageName, StageRecord | None],
    contents: Mapping[StageName, dict[str, str]],
) -> Iterator[Finding]:
    """Whether the stages before it are those that it was made from; an edit made before it is one of them."""
    made_from: dict[StageName, Any] = {source: record.settings.get(key) for key, source in OLD_SOURCES[stage].items()}
    table = _table(record.settings, "stages")
    if table or stage == "report":
        made_from = {source: table.get(source) for source in STAGES if source in table}
    for source, used in made_from.items():
        before = records[source]
        if before is None:
            yield _record(stage, "changed", f"it was made from a stage '{source}' that is not there")
        elif used not in (before.outputs, contents[source]):
            yield _record(stage, "changed", f"it was made from other results of stage '{source}'")


def _databases(record: StageRecord, stage: StageName, known: Mapping[str, Path]) -> Iterator[Finding]:
    for name, recorded in _table(record.settings, "databases").items():
        path = known.get(name)
        yield (
            _compared("database", stage, name, recorded, path)
            if path is not None
            else Finding(part="database", stage=stage, name=name, state="missing")
        )
    for name, recorded in _table(record.settings, "model").items():
        yield _compared("database", stage, name, recorded, SHIPPED_MODEL)


def _inputs(record: StageRecord, stage: StageName, base: Path) -> Iterator[Finding]:
    folder = base
    if "section" in record.settings and stage == "scan":  # of earlier packages: named from the scan's folder
        folder = (base / str(_table(record.settings, "section").get("file", ""))).parent
    for name, recorded in _table(record.settings, "files").items():
        yield _compared("input", stage, name, recorded, folder / name)


def _table(settings: Mapping[str, Any], key: str) -> dict[str, Any]:
    """A table of a record's settings; empty where a stage has none."""
    found = settings.get(key)
    return found if isinstance(found, dict) else {}


def _version_notes(records: Mapping[StageName, StageRecord | None]) -> Iterator[str]:
    """One note on all libraries whose version differs from that with which the stages were made."""
    here = versions()
    then = {
        (name, made)
        for record in records.values()
        if record is not None
        for name, made in record.versions.items()
        if here.get(name) != made
    }
    if then:
        listed = ", ".join(f"{name} {made} (here {here.get(name, 'none')})" for name, made in sorted(then))
        yield f"The run was made with other versions: {listed}. A new run may give slightly different numbers."
