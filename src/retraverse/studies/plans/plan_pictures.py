"""The tables of a plan that say what is done to pictures: images, compression, video.

They become pairs: what is done to the query's pictures and what to the map's.
"""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, cast, get_args

from retraverse.errors import ConfigError
from retraverse.images import Encoder, QuantisationTables, VideoGroups, Worsening
from retraverse.images.codecs import GROUP_CODECS, CodecName, codec_versions
from retraverse.images.jpeg_parts import JPEG_PARTS
from retraverse.images.worsening import Resizer
from retraverse.registry import read_parameters, unknown_name
from retraverse.studies.plans.plan import PairRule, PicturePair, compression_pairs
from retraverse.studies.plans.table_reader import Table, TableReader
from retraverse.studies.plans.tables_file import load_tables, read_tables

__all__ = ["EVERY_PART", "WHOLE", "read_pairs"]

WHOLE = "whole"
"""As a part of JPEG: all of it, as a file."""
EVERY_PART = "every"
"""As a part of JPEG: each of them, and all of it."""
_COMPRESSION_KEYS = ("levels", "pairs", "other", "query", "reference", "parts")


def read_pairs(reader: TableReader, plan: Table, root: Path) -> tuple[PicturePair, ...]:
    """Return what is done to the pictures, each pair once; problems go to the reader.

    Parameters
    ----------
    reader : TableReader
    plan : Table
        The whole plan.
    root : Path
        The folder that paths in it start from.
    """
    images = reader.value("images", plan, dict, {})
    compression = reader.value("compression", plan, dict, {})
    reader.known_keys("images", images, ("resize", "resizer", "encoders"))
    reader.known_keys("compression", compression, _COMPRESSION_KEYS)
    sizes = _sizes(reader, images)
    if sizes is None:
        return ()
    encoders = [
        reader.attempt(partial(_encoder, value, root))
        for value in reader.listed("encoders", images, dict, [{}], "images")
    ]
    pairs = [
        *_compressed(reader, compression, sizes, [encoder or Encoder() for encoder in encoders]),
        *_as_video(reader, plan, sizes, _other(reader, compression)),
    ]
    return tuple(dict.fromkeys(map(_settled, pairs)))


@dataclass(frozen=True)
class _Size:
    """How pictures are resized."""

    side: int | None
    resizer: Resizer

    def worsening(self, **further: Any) -> Worsening:
        """Return it with what is done to resized pictures."""
        return Worsening(self.side, self.resizer, **further)


def _sizes(reader: TableReader, images: Table) -> list[_Size] | None:
    """Return the sizes asked for, None if one of them cannot be."""
    resizer = reader.value("resizer", images, str, "pillow", "images")
    sides = [side or None for side in reader.listed("resize", images, int, [0], "images")]
    # The resizer is a text until `Worsening` has checked it.
    sizes = [_Size(side, cast(Resizer, resizer)) for side in sides]
    sound = [reader.attempt(size.worsening) for size in sizes]
    return None if None in sound else sizes


def _compressed(
    reader: TableReader, table: Table, sizes: list[_Size], encoders: list[Encoder]
) -> Iterator[PicturePair]:
    """Yield the pairs of JPEG files, and of single parts of JPEG's damage."""
    parts = _parts(reader, table)
    for size, encoder, levels, part in itertools.product(
        sizes, encoders, _levels_of_pairs(reader, table), parts
    ):
        made = [
            reader.attempt(
                partial(
                    size.worsening,
                    compression=level,
                    encoder=encoder,
                    part="" if level is None else part,
                )
            )
            for level in levels
        ]
        sides = [worsening for worsening in made if worsening is not None]
        if len(sides) == 2:
            yield PicturePair(*sides)


def _parts(reader: TableReader, table: Table) -> list[str]:
    """Return the parts of JPEG's damage as `Worsening` has them."""
    named = reader.listed("parts", table, str, [WHOLE], "compression")
    known = [WHOLE, EVERY_PART, *JPEG_PARTS]
    for part in named:
        if part not in known:
            reader.problems.append(unknown_name("compression.parts", part, known))
    if EVERY_PART in named:
        return ["", *JPEG_PARTS]
    return ["" if part == WHOLE else part for part in named if part in known]


def _as_video(
    reader: TableReader, plan: Table, sizes: list[_Size], other: int | None
) -> Iterator[PicturePair]:
    """Yield the pairs whose query is sent as groups of a video codec."""
    table = reader.value("video", plan, dict, {})
    reader.known_keys("video", table, (*GROUP_CODECS, "group"))
    if not table or reader.attempt(codec_versions) is None:
        return
    length = reader.value("group", table, int, VideoGroups().length, "video")
    for codec in GROUP_CODECS:
        qualities = reader.listed(codec, table, int, [], "video")
        for size, quality in itertools.product(sizes, qualities):
            sent = reader.attempt(partial(VideoGroups, cast(CodecName, codec), quality, length))
            if sent is not None:
                yield PicturePair(size.worsening(video=sent), size.worsening(compression=other))


def _levels_of_pairs(
    reader: TableReader, table: Table
) -> tuple[tuple[int | None, int | None], ...]:
    """Return the (query c, reference c) of all pairs."""
    sides = [key for key in ("query", "reference") if key in table]
    if "levels" in table and sides:
        reader.problems.append(
            f"compression: got levels and {sides[0]}, expected levels with pairs, or query "
            "and reference"
        )
    if sides:
        query, reference = (_levels(reader, key, table, ["none"]) for key in ("query", "reference"))
        return tuple(itertools.product(query, reference))
    levels = _levels(reader, "levels", table, ["none"])
    return compression_pairs(tuple(levels), _rules(reader, table), _other(reader, table))


def _other(reader: TableReader, table: Table) -> int | None:
    """Return c of the side that is left alone."""
    levels = _levels(reader, "other", {"other": [table.get("other", "none")]}, [])
    return levels[0] if levels else None


def _levels(reader: TableReader, key: str, table: Table, default: list[Any]) -> list[int | None]:
    values = reader.listed(key, table, (int, str), default, "compression")
    for value in values:
        if not (value == "none" or (isinstance(value, int) and 0 <= value <= 99)):
            reader.problems.append(
                f"compression.{key}: got {value!r}, expected whole numbers from 0 to 99, or "
                "'none' for pictures as they are"
            )
    return [value if isinstance(value, int) else None for value in values]


def _rules(reader: TableReader, table: Table) -> tuple[PairRule, ...]:
    rules = reader.listed("pairs", table, str, ["uniform"], "compression")
    known = sorted(get_args(PairRule))
    for rule in rules:
        if rule not in known:
            reader.problems.append(unknown_name("compression.pairs", rule, known))
    return tuple(rule for rule in rules if rule in known)


def _settled(pair: PicturePair) -> PicturePair:
    """Return the pair without options that make no difference, so that no run is there twice."""

    def settle(worsening: Worsening) -> Worsening:
        plain = Worsening()
        settled = worsening
        if worsening.resize is None:
            settled = replace(settled, resizer=plain.resizer)
        if worsening.compression is None:
            settled = replace(settled, encoder=plain.encoder)
        return settled

    return PicturePair(settle(pair.query), settle(pair.reference))


def _encoder(table: Mapping[str, Any], root: Path) -> Encoder:
    """Return the encoder of a table of options."""
    known = [field.name for field in fields(Encoder)]
    for key in table:
        if key not in known:
            raise ConfigError(unknown_name("key in images.encoders", key, known))
    tables = _tables(table["tables"], root) if "tables" in table else None
    flags = {key: value for key, value in table.items() if isinstance(value, bool)}
    words = {key: value for key, value in table.items() if key not in (*flags, "tables")}
    for key in flags:
        if key not in ("optimize", "progressive"):
            raise ConfigError(f"images.encoders: {key}: got {flags[key]}, expected a text")
    for key in words:
        if key in ("optimize", "progressive"):
            raise ConfigError(f"images.encoders: {key}: got {words[key]!r}, expected true or false")
    chosen: Encoder = read_parameters("images.encoders", Encoder, words)
    return replace(
        chosen,
        optimize=flags.get("optimize", chosen.optimize),
        progressive=flags.get("progressive", chosen.progressive),
        tables=tables,
    )


def _tables(value: object, root: Path) -> QuantisationTables:
    """Return the tables of a file's path, or those that are in the plan itself."""
    where = "images.encoders: tables"
    if isinstance(value, str):
        return load_tables(root / value)
    if isinstance(value, dict):
        return read_tables(value, where)
    raise ConfigError(
        f"{where}: got {value!r}, expected the path of a JSON file, or a table with luminance "
        "and chrominance"
    )
