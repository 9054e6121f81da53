"""From a TOML file to a plan, or to the list of all that is wrong with it.

The keys (all but ``datasets`` and ``techniques`` may be left out)::

    name = "chapter 6 with HOG"
    chapter = "6"
    data = "datasets"                  # data root, from the plan's folder
    datasets = ["stromovka"]           # or { name, query, reference, truth | radius_m | tolerance }
    techniques = ["cohog", { name = "hog", parameters = { form = "chapter6" } }]
    matchers = ["mean", { name = "seqslam", sequence_lengths = [10] }]
    sequence_lengths = ["1..20", "dynamic"]
    seeds = [0]
    entropy = false
    modules = []                       # Python modules that register techniques of your own

    [images]
    resize = [256]                     # side in pixels; 0 = as they are
    resizer = "opencv"                 # or "pillow"
    encoders = [{ optimize = true }, { tables = "tables.json" }]   # from the plan's folder

    [compression]
    levels = [0, 50, 80, 90, 95, 97, 99]   # "none" = pictures as they are
    pairs = ["uniform", "query", "reference"]   # or "grid"; or query = [...], reference = [...]
    other = 0                          # c of the side that "query" and "reference" leave alone
"""

import importlib
import itertools
import tomllib
from collections.abc import Mapping
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any, cast, get_args

from retraverse.datasets.known import Dataset, find_dataset, known_dataset, open_dataset
from retraverse.errors import ConfigError, DataMissingError, InputError
from retraverse.images import QuantisationTables
from retraverse.images.jpeg import Encoder
from retraverse.images.worsen import Resizer, Worsening
from retraverse.matching import SequenceLength
from retraverse.registry import read_parameters, unknown_name
from retraverse.studies.plan import (
    MatcherChoice,
    PairRule,
    PicturePair,
    StudyPlan,
    TechniqueChoice,
    compression_pairs,
)
from retraverse.studies.plan_checks import PlanError, plan_problems
from retraverse.studies.table_reader import Table, TableReader
from retraverse.studies.tables_file import load_tables, read_tables

__all__ = ["PlanError", "load_plan", "read_plan"]

_KEYS = (
    "name",
    "chapter",
    "data",
    "datasets",
    "techniques",
    "matchers",
    "sequence_lengths",
    "seeds",
    "entropy",
    "modules",
    "images",
    "compression",
)
_LONGEST_LENGTH = 100_000


def load_plan(
    path: str | Path, *, data: str | Path | None = None, on_missing: str = "refuse"
) -> StudyPlan:
    """Read a plan and check all of it.

    Parameters
    ----------
    path : path
        The TOML file.
    data : path, optional
        The data root, in place of the plan's.
    on_missing : {"refuse", "record"}
        What a dataset that is not here is: a problem, or a record that says so.

    Raises
    ------
    DataMissingError
        If there is no such file.
    PlanError
        If anything is wrong with it; all problems at once, one line each.
    """
    place = Path(path)
    try:
        text = place.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise DataMissingError(f"plan {place}: no such file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"plan {place}: cannot be read: {error}") from error
    root = place.parent if data is None else Path(data)
    return read_plan(text, source=str(place), root=root, data=data, on_missing=on_missing)


def read_plan(
    text: str,
    *,
    source: str = "text",
    root: Path = Path(),
    data: str | Path | None = None,
    on_missing: str = "refuse",
) -> StudyPlan:
    """Return the plan that a TOML text describes; see `load_plan`.

    Parameters
    ----------
    text : str
        TOML.
    source : str
        What messages call it.
    root : Path
        The folder that paths in the text start from.
    data, on_missing
        As in `load_plan`.
    """
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise PlanError(source, [f"not TOML: {error}"]) from error
    reader = _Reader(table, root, None if data is None else Path(data), on_missing == "record")
    plan = reader.plan(Path(source).stem)
    problems = list(dict.fromkeys([*reader.problems, *plan_problems(plan)]))
    if problems:
        raise PlanError(source, problems)
    return replace(plan, text=text)


class _Reader(TableReader):
    """Reads the tables of a plan and gathers what is wrong with them."""

    def __init__(self, table: Table, root: Path, data: Path | None, records_missing: bool) -> None:
        super().__init__()
        self._table = table
        self._root = root
        self._data = data
        self._records_missing = records_missing
        self._missing: list[str] = []

    def plan(self, default_name: str) -> StudyPlan:
        """Return the plan: whole where there are no problems."""
        table = self._table
        self.known_keys("the plan", table, _KEYS)
        modules = tuple(self.listed("modules", table, str, []))
        for module in modules:
            self.attempt(partial(_import, module))
        found = [self._dataset(value) for value in self.listed("datasets", table, (str, dict))]
        techniques = [
            self._technique(value) for value in self.listed("techniques", table, (str, dict))
        ]
        matchers = self.listed("matchers", table, (str, dict), ["mean"])
        plan = StudyPlan(
            name=self.value("name", table, str, default_name),
            chapter=self.value("chapter", table, str, ""),
            datasets=tuple(dataset for dataset in found if dataset is not None),
            techniques=tuple(technique for technique in techniques if technique is not None),
            pairs=self._pairs(),
            matchers=self._matchers(matchers),
            sequence_lengths=self._lengths("sequence_lengths", table) or (1,),
            seeds=self._seeds(),
            entropy=self.value("entropy", table, bool, False),
            modules=modules,
            missing=tuple(self._missing),
        )
        self.nothing_twice("datasets", [dataset.name for dataset in plan.datasets])
        return plan

    def _dataset(self, value: str | Table) -> Dataset | None:
        if isinstance(value, dict):
            return self._own_dataset(value)
        data = self._data or self._root / self.value("data", self._table, str, ".")
        dataset = self.attempt(lambda: find_dataset(value, data))
        if dataset is None:
            known = "" if known_dataset(value) else " (nor is it known by that name)"
            if self._records_missing:
                self._missing.append(value)
            else:
                self.problems.append(f"dataset {value}: not in {data}{known}")
        return dataset

    def _own_dataset(self, table: Table) -> Dataset | None:
        keys = ("name", "query", "reference", "truth", "radius_m", "tolerance", "every")
        self.known_keys("a dataset", table, keys)
        names = [self.value(key, table, str, "", "a dataset") for key in keys[:3]]
        if not all(names):
            self.problems.append("a dataset: expected name, query and reference, each a text")
            return None
        truth = self.value("truth", table, str, "", "a dataset")
        radius = table.get("radius_m")
        return self.attempt(
            lambda: open_dataset(
                names[0],
                self._root / names[1],
                self._root / names[2],
                truth_file=self._root / truth if truth else None,
                radius_m=None if radius is None else float(radius),
                tolerance_frames=self.whole("tolerance", table, 2, least=0),
                every=self.whole("every", table, 1, least=1),
            )
        )

    def _technique(self, value: str | Table) -> TechniqueChoice | None:
        table = {"name": value} if isinstance(value, str) else value
        keys = ("name", "parameters", "sequence_lengths", "matchers")
        self.known_keys("a technique", table, keys)
        return TechniqueChoice(
            self.value("name", table, str, "", "a technique"),
            self.value("parameters", table, dict, {}, "a technique"),
            self._lengths("sequence_lengths", table),
            self._matchers(self.listed("matchers", table, (str, dict), [])),
        )

    def _matchers(self, values: list[Any]) -> tuple[MatcherChoice, ...]:
        return tuple(made for value in values if (made := self._matcher(value)) is not None)

    def _matcher(self, value: str | Table) -> MatcherChoice | None:
        table = {"name": value} if isinstance(value, str) else value
        self.known_keys("a matcher", table, ("name", "parameters", "sequence_lengths"))
        choice = MatcherChoice(
            self.value("name", table, str, "", "a matcher"),
            self.value("parameters", table, dict, {}, "a matcher"),
            self._lengths("sequence_lengths", table),
        )
        return None if self.attempt(choice.make) is None else choice

    def _lengths(self, key: str, table: Table) -> tuple[SequenceLength, ...]:
        lengths: list[SequenceLength] = []
        for value in self.listed(key, table, (int, str), []):
            lengths.extend(self._length(key, value))
        return tuple(dict.fromkeys(lengths))

    def _length(self, key: str, value: int | str) -> list[SequenceLength]:
        if value == "dynamic":
            return ["dynamic"]
        first, dots, last = str(value).partition("..")
        ends = (first, last if dots else first)
        if all(end.isascii() and end.isdigit() for end in ends):
            low, high = int(ends[0]), int(ends[1])
            if 1 <= low <= high <= _LONGEST_LENGTH:
                return list(range(low, high + 1))
        self.problems.append(
            f"{key}: got {value!r}, expected a whole number from 1, a range like '1..20', or "
            "'dynamic'"
        )
        return []

    def _seeds(self) -> tuple[int, ...]:
        seeds = self.listed("seeds", self._table, int, [0])
        for seed in seeds:
            if seed < 0:
                self.problems.append(f"seeds: got {seed}, expected whole numbers from 0")
        return tuple(dict.fromkeys(seeds))

    def _pairs(self) -> tuple[PicturePair, ...]:
        images = self.value("images", self._table, dict, {})
        self.known_keys("images", images, ("resize", "resizer", "encoders"))
        encoders = [
            self.attempt(partial(_encoder, value, self._root))
            for value in self.listed("encoders", images, dict, [{}], "images")
        ]
        sizes = [size or None for size in self.listed("resize", images, int, [0], "images")]
        resizer = self.value("resizer", images, str, "pillow", "images")
        levels_of_pairs = self._compressions()
        sound = [self.attempt(partial(_worsening, size, resizer)) for size in sizes]
        if None in sound:
            return ()
        pairs = []
        for size, encoder, levels in itertools.product(sizes, encoders, levels_of_pairs):
            made = [
                self.attempt(partial(_worsening, size, resizer, level, encoder or Encoder()))
                for level in levels
            ]
            sides = [worsening for worsening in made if worsening is not None]
            pairs += [PicturePair(*sides)] if len(sides) == 2 else []
        return tuple(dict.fromkeys(map(_settled, pairs)))

    def _compressions(self) -> tuple[tuple[int | None, int | None], ...]:
        table = self.value("compression", self._table, dict, {})
        self.known_keys("compression", table, ("levels", "pairs", "other", "query", "reference"))
        sides = [key for key in ("query", "reference") if key in table]
        if "levels" in table and sides:
            self.problems.append(
                f"compression: got levels and {sides[0]}, expected levels with pairs, or query "
                "and reference"
            )
        if sides:
            query, reference = (
                self._levels(key, table, ["none"]) for key in ("query", "reference")
            )
            return tuple(itertools.product(query, reference))
        levels = self._levels("levels", table, ["none"])
        other = (
            self._levels("other", {"other": [table["other"]]}, []) if "other" in table else [None]
        )
        return compression_pairs(tuple(levels), self._rules(table), *other[:1])

    def _levels(self, key: str, table: Table, default: list[Any]) -> list[int | None]:
        values = self.listed(key, table, (int, str), default, "compression")
        for value in values:
            if not (value == "none" or (isinstance(value, int) and 0 <= value <= 99)):
                self.problems.append(
                    f"compression.{key}: got {value!r}, expected whole numbers from 0 to 99, or "
                    "'none' for pictures as they are"
                )
        return [value if isinstance(value, int) else None for value in values]

    def _rules(self, table: Table) -> tuple[PairRule, ...]:
        rules = self.listed("pairs", table, str, ["uniform"], "compression")
        known = sorted(get_args(PairRule))
        for rule in rules:
            if rule not in known:
                self.problems.append(unknown_name("compression.pairs", rule, known))
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


def _worsening(
    size: int | None, resizer: str, level: int | None = None, encoder: Encoder | None = None
) -> Worsening:
    """Return what is done to a picture; the resizer is a text until it is checked there."""
    return Worsening(size, cast(Resizer, resizer), level, encoder or Encoder())


def _import(module: str) -> None:
    try:
        importlib.import_module(module)
    except Exception as error:
        raise ConfigError(f"modules: {module} cannot be imported: {error}") from error
