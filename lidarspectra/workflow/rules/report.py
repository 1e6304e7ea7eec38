"""A check against rules as it is kept in RUN/rules, its page, and the report's section of it."""

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from lidarspectra.arrays import ByteArray
from lidarspectra.config import RulesSection
from lidarspectra.errors import MapError, WorkspaceError
from lidarspectra.io.files import hash_file, write_whole, writing
from lidarspectra.mapping.figures.room_pictures import tone_mapped
from lidarspectra.mapping.report import report_page as html
from lidarspectra.mapping.report.applications import Application, ApplicationFigure
from lidarspectra.mapping.report.report_sections import application_section
from lidarspectra.mapping.report.report_writer import ReportWriter
from lidarspectra.mapping.rules.rule_figures import (
    looks_figure,
    looks_table,
    rules_figure,
    rules_table,
    whole_table,
)
from lidarspectra.mapping.rules.rule_record import (
    RECORD_FILE,
    LookRow,
    RuleRecord,
    load_rules,
    record_text,
    rule_rows,
    whole_rules,
)
from lidarspectra.radiance.pictures.hdr_file import save_hdr
from lidarspectra.workflow.rules.rules_of_run import RuleCheck
from lidarspectra.workflow.rules.year import year_of_run
from lidarspectra.workflow.run_folder.workspace import made_folder, read_record, stage_folder, writing_run

FOLDER = "rules"
PAGE = "index.html"
TITLE = "Rules"


def save_rules(check: RuleCheck, run: Path, folder: Path | None = None) -> tuple[RuleRecord, Path]:
    """Write a check: its record, what people see (PNG and HDR), and a page of it with tables and figures.

    Parameters
    ----------
    check : RuleCheck
    run : Path
        The run that was checked.
    folder : Path, optional
        RUN/rules by default, where the report finds it.

    Returns
    -------
    record : RuleRecord
    page : Path

    Raises
    ------
    WorkspaceError, MapError, SceneError
        If something cannot be written.
    """
    target = made_folder(run / FOLDER if folder is None else folder)
    with writing_run(target):
        looks = _save_looks(check, target)
        record = RuleRecord(
            rows=rule_rows(check.criteria),
            whole=whole_rules(check.criteria),
            absent=check.absent,
            looks=looks,
            areas={area.name: list(area.polygon) for area in check.areas},
            notes=check.notes,
            of=_of(check.section, run),
        )
        write_whole(target / RECORD_FILE, record_text(record))
    writer = ReportWriter(target)
    section = _section(record, target)
    content = application_section(section, writer)
    page = html.page(
        title=f"Rules: {run.resolve().name}",
        lead="The light of a run against rules, each with the probability that it is kept.",
        sections=[html.Section(anchor="rules", title=TITLE, content=content)],
        footer="Made by LiDARSpectra.",
    )
    with writing(target, error=MapError):
        write_whole(target / PAGE, page)
    return record, target / PAGE


def rules_sections(section: RulesSection | None, run: Path) -> tuple[Application, ...]:
    """The report's section, or none where there is no check of just these rules and this map.

    Raises
    ------
    WorkspaceError
        If it cannot be read.
    """
    record = load_rules(run / FOLDER)
    if record is None or record.of != _of(section or RulesSection(), run):
        return ()
    return (_section(record, run / FOLDER),)


def _of(section: RulesSection, run: Path) -> dict[str, Any]:
    """What a check is of: the rules, and by their hashes the map's files and the year of daylight."""
    made, year = read_record(stage_folder(run, "map")), year_of_run(run)
    return {
        "rules": section.model_dump(mode="json"),
        "map": {} if made is None else dict(made.outputs),
        "year": hash_file(year) if year.is_file() else None,
    }


def _save_looks(check: RuleCheck, folder: Path) -> tuple[LookRow, ...]:
    for path in folder.glob("look-*"):  # of an earlier check
        path.unlink()
    found = []
    for number, look in enumerate(check.looks, start=1):
        name = f"look-{number}.png"
        picture = look.picture
        Image.fromarray(tone_mapped(picture.xyz, check.white_xyz)).save(folder / name)
        save_hdr(picture.xyz, picture.view, folder / f"look-{number}.hdr")
        x, y, z = (float(value) for value in picture.view.eye)
        found.append(
            LookRow(
                area=look.area,
                angle_deg=look.angle_deg,
                eye=(x, y, z),
                ugr=max(look.luminaires.ugr, 0.0),
                evalglare_ugr=look.glare.ugr,
                dgp=look.glare.dgp,
                picture=name,
            )
        )
    return tuple(found)


def _section(record: RuleRecord, folder: Path) -> Application:
    figures = [
        ApplicationFigure(
            name="rules",
            figure=rules_figure(record.rows),
            caption="Every requirement: the best estimate (dot) and the range from 5 to 95 % over the limit. Right of "
            "the line the requirement is kept. Blue: kept with 95 % probability or more; red: with 5 % or less.",
        )
    ]
    tables = [whole_table(record), rules_table(record)]
    if record.looks:
        pictures = [_picture(folder / look.picture) for look in record.looks]
        caption = "What people in the areas see, all of the hemisphere before them."
        figures.append(ApplicationFigure(name="glare", figure=looks_figure(record.looks, pictures), caption=caption))
        tables.append(looks_table(record))
    return Application(title=TITLE, words=record.notes, figures=tuple(figures), tables=tuple(tables))


def _picture(path: Path) -> ByteArray:
    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGB"), dtype=np.uint8)
    except OSError as cause:
        raise WorkspaceError(
            expected="a picture that 'lidarspectra rules' wrote",
            found=str(cause),
            where=str(path),
            todo="Give 'lidarspectra rules' again, or delete the folder.",
        ) from cause
