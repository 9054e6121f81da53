"""From a TOML file to a plan, or to the list of all that is wrong with it.

The keys (all but ``datasets`` and ``techniques`` may be left out)::

    name = "chapter 6 with HOG"
    chapter = "6"
    data = "datasets"                  # data root, from the plan's folder
    datasets = ["stromovka"]           # or { name, query, reference, truth | radius_m | tolerance }
    speeds = ["constant"]              # the query driven again: "varying", "stops", "backwards",
                                       # "detour", "jump"; every dataset at every speed
    techniques = ["cohog", { name = "hog", parameters = { form = "chapter6" } }]
    sent = ["pictures"]                # or descriptors: "exact", "float16", "int8", "sketch",
                                       # { name = "projected", parameters = { dimensions = 32 } }
    matchers = ["mean", { name = "seqslam", sequence_lengths = [10] }]
    sequence_lengths = ["1..20", "dynamic"]
    seeds = [0]
    entropy = false
    legibility = false                 # how large writing must be to be read
    modules = []                       # Python modules that register techniques of your own

    [images]
    resize = [256]                     # side in pixels; 0 = as they are
    resizer = "opencv"                 # or "pillow"
    encoders = [{ optimize = true }, { tables = "tables.json" }]   # from the plan's folder

    [compression]
    levels = [0, 50, 80, 90, 95, 97, 99]   # "none" = pictures as they are
    pairs = ["uniform", "query", "reference"]   # or "grid"; or query = [...], reference = [...]
    other = 0                          # c of the side that "query" and "reference" leave alone
    parts = ["whole"]                  # parts of JPEG's damage alone: "grid", ...; "every" = each

    [video]                            # the query as groups of a codec; the map at `other`
    h265 = [30, 35]                    # quality factors, larger is coarser
    av1 = [40]
    group = 8                          # pictures a group: 1, 2, 4, 8, 16 or 32
"""

import importlib
import itertools
import tomllib
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from retraverse.datasets.driven_again import driven_again
from retraverse.datasets.known import Dataset, find_dataset, known_dataset, open_dataset
from retraverse.datasets.resample import PROFILES
from retraverse.errors import ConfigError, DataMissingError, InputError
from retraverse.matching import SequenceLength
from retraverse.registry import unknown_name
from retraverse.studies.plans.plan import MatcherChoice, PlanOrigin, StudyPlan, TechniqueChoice
from retraverse.studies.plans.plan_checks import PlanError, plan_problems
from retraverse.studies.plans.plan_pictures import read_pairs
from retraverse.studies.plans.table_reader import Table, TableReader
from retraverse.techniques.sending import CODINGS, Coding, coding

__all__ = ["PlanError", "load_plan", "plan_datasets", "read_plan"]

_KEYS = (
    "name",
    "chapter",
    "data",
    "datasets",
    "speeds",
    "techniques",
    "sent",
    "matchers",
    "sequence_lengths",
    "seeds",
    "entropy",
    "legibility",
    "modules",
    "images",
    "compression",
    "video",
)
PICTURES = "pictures"
"""As what is sent: the query's pictures, which are described where the map is."""
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
    origin = PlanOrigin(root.absolute(), None if data is None else Path(data).absolute())
    return replace(plan, text=text, origin=origin)


def plan_datasets(text: str, origin: PlanOrigin) -> tuple[Dataset, ...]:
    """Return the datasets of a plan that are here, and look at nothing else of it.

    Modules that the plan names are not imported: whoever looks at a study need not run its code.

    Raises
    ------
    InputError
        If it is no TOML.
    """
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"plan: not TOML: {error}") from error
    return _Reader(table, origin.root, origin.data, True).datasets()


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
        techniques = [
            self._technique(value) for value in self.listed("techniques", table, (str, dict))
        ]
        matchers = self.listed("matchers", table, (str, dict), ["mean"])
        plan = StudyPlan(
            name=self.value("name", table, str, default_name),
            chapter=self.value("chapter", table, str, ""),
            datasets=self.datasets(),
            techniques=tuple(technique for technique in techniques if technique is not None),
            pairs=read_pairs(self, table, self._root),
            sent=self._sent(table, [PICTURES]),
            matchers=self._matchers(matchers),
            sequence_lengths=self._lengths("sequence_lengths", table) or (1,),
            seeds=self._seeds(),
            entropy=self.value("entropy", table, bool, False),
            legibility=self.value("legibility", table, bool, False),
            modules=modules,
            missing=tuple(self._missing),
        )
        self.nothing_twice("datasets", [dataset.name for dataset in plan.datasets])
        return plan

    def datasets(self) -> tuple[Dataset, ...]:
        """Return the datasets that are here, at every speed of the plan."""
        listed = self.listed("datasets", self._table, (str, dict))
        found = [self._dataset(value) for value in listed]
        return self._at_every_speed([dataset for dataset in found if dataset is not None])

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

    def _at_every_speed(self, datasets: list[Dataset]) -> tuple[Dataset, ...]:
        """Return every dataset at every speed of the plan."""
        speeds = self.listed("speeds", self._table, str, ["constant"])
        for speed in speeds:
            if speed not in PROFILES:
                self.problems.append(unknown_name("speed in speeds", speed, list(PROFILES)))
        known = dict.fromkeys(speed for speed in speeds if speed in PROFILES)
        pairs = itertools.product(datasets, known)
        return tuple(driven_again(dataset, speed) for dataset, speed in pairs)

    def _technique(self, value: str | Table) -> TechniqueChoice | None:
        table = {"name": value} if isinstance(value, str) else value
        keys = ("name", "parameters", "sequence_lengths", "matchers", "sent")
        self.known_keys("a technique", table, keys)
        return TechniqueChoice(
            self.value("name", table, str, "", "a technique"),
            self.value("parameters", table, dict, {}, "a technique"),
            self._lengths("sequence_lengths", table),
            self._matchers(self.listed("matchers", table, (str, dict), [])),
            self._sent(table, []),
        )

    def _sent(self, table: Table, default: list[Any]) -> tuple[Coding | None, ...]:
        """Return what is sent, each once: None = pictures."""
        found: list[Coding | None] = []
        for value in self.listed("sent", table, (str, dict), default):
            chosen = {"name": value} if isinstance(value, str) else value
            self.known_keys("sent", chosen, ("name", "parameters"))
            name = self.value("name", chosen, str, "", "sent")
            parameters = self.value("parameters", chosen, dict, {}, "sent")
            if name == PICTURES:
                found.append(None)
                if parameters:
                    self.problems.append(f"sent: got {PICTURES} with parameters, expected none")
            elif (made := self.attempt(partial(_coding, name, parameters))) is not None:
                found.append(made)
        return tuple(dict.fromkeys(found))

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


def _coding(name: str, parameters: Table) -> Coding:
    if name not in CODINGS:
        raise ConfigError(unknown_name("sent", name, [PICTURES, *CODINGS]))
    return coding(name, **parameters)


def _import(module: str) -> None:
    try:
        importlib.import_module(module)
    except Exception as error:
        raise ConfigError(f"modules: {module} cannot be imported: {error}") from error
