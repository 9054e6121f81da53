"""The list of datasets known by name: whose they are, and what is true of them."""

from dataclasses import dataclass

__all__ = ["KNOWN", "KnownDataset"]

NO_LICENCE_TEXT = "no licence text: for research, not to be passed on"


@dataclass(frozen=True)
class KnownDataset:
    """What is known of a dataset before its pictures are."""

    name: str
    """What plans call it."""
    title: str
    """What people call it."""
    citation: str
    """Author, title, venue, year; "" for a route of one's own."""
    licence: str = NO_LICENCE_TEXT
    """Terms, as far as they are stated."""
    folders: tuple[str, ...] = ()
    """What its folder may be called beside `name`."""
    query: tuple[str, ...] = ("query", "live")
    """What the query drive's folder may be called, inside."""
    reference: tuple[str, ...] = ("reference", "ref", "memory")
    """What the reference drive's folder may be called."""
    every: int = 1
    """Only every so many-th file is used."""
    tolerance_frames: int = 2
    """References i - tolerance to i + tolerance are right."""
    thesis_sizes: tuple[int, int] | None = None
    """(queries, references) in the thesis; None if it is not in it."""
    note: str = ""
    """What a reader must know of it."""


_gardens_point = (
    "Sünderhauf, Shirazi, Dayoub, Upcroft, Milford: On the Performance of ConvNet Features for "
    "Place Recognition, IROS 2015; pictures by Glover, Queensland University of Technology, 2014"
)
_nordland = (
    "Sünderhauf, Neubert, Protzel: Are We There Yet? Challenging SeqSLAM on a 3000 km Journey "
    "Across All Four Seasons, ICRA Workshop on Long-Term Autonomy, 2013; pictures by NRK, 2012"
)
KNOWN = (
    KnownDataset(
        "corridor",
        "Corridor",
        "Milford: Vision-based place recognition: how low can you go?, International Journal of "
        "Robotics Research, 2013; as in VPR-Bench",
        note="160 x 120 pixels, indoors",
    ),
    KnownDataset(
        "stromovka",
        "Stromovka",
        "Krajník, Cristóforis, Kusumam, Neubert, Duckett: Image features for visual "
        "teach-and-repeat navigation in changing environments, Robotics and Autonomous Systems, "
        "2017",
        query=("snow",),
        reference=("autumn",),
        note="a park path, autumn and snow; frames correspond by number",
    ),
    KnownDataset(
        "gardens_point_thumbnails",
        "Gardens Point (thumbnails)",
        _gardens_point,
        note="about 97 x 54 pixels, cut from published result sheets: never the published set",
    ),
    KnownDataset(
        "nordland_64x32",
        "Nordland 64x32, every 20th",
        _nordland,
        query=("winter",),
        reference=("summer",),
        every=20,
        tolerance_frames=1,
        note="grey, 64 x 32 pixels, every 20th frame of 3576; tunnels included",
    ),
    KnownDataset(
        "campus_loop",
        "Campus Loop",
        "Merrill, Huang: Lightweight Unsupervised Deep Loop Closure, Robotics: Science and "
        "Systems, 2018",
        folders=("CampusLoopDataset", "campus-loop"),
        thesis_sizes=(100, 100),
    ),
    KnownDataset(
        "gardens_point_day",
        "Gardens Point, day to day",
        _gardens_point,
        folders=("gardens_point", "GardensPoint", "GardensPointWalking"),
        query=("day_left", "query"),
        reference=("day_right", "ref", "reference"),
        thesis_sizes=(200, 200),
    ),
    KnownDataset(
        "gardens_point_night",
        "Gardens Point, day to night",
        _gardens_point,
        folders=("gardens_point", "GardensPoint", "GardensPointWalking"),
        query=("day_left",),
        reference=("night_right",),
        thesis_sizes=(200, 200),
    ),
    KnownDataset(
        "nordland",
        "Nordland",
        _nordland,
        folders=("Nordland",),
        query=("summer", "query"),
        reference=("winter", "ref", "reference"),
        tolerance_frames=1,
        thesis_sizes=(172, 172),
    ),
    KnownDataset(
        "essex3in1",
        "ESSEX3IN1",
        "Zaffar, Ehsan, Milford, McDonald-Maier: Memorable Maps: A Framework for Re-Defining "
        "Places in Visual Place Recognition, IEEE Transactions on Intelligent Transportation "
        "Systems, 2021",
        folders=("ESSEX3IN1", "ESSEX3IN1_dataset"),
        tolerance_frames=0,
        thesis_sizes=(210, 210),
        note="places, not a drive: query i shows place i alone",
    ),
    KnownDataset(
        "oxford_robotcar",
        "Oxford RobotCar",
        "Maddern, Pascoe, Linegar, Newman: 1 Year, 1000 km: The Oxford RobotCar Dataset, "
        "International Journal of Robotics Research, 2017",
        licence="CC BY-NC-SA 4.0",
        folders=("robotcar", "OxfordRobotCar", "ORCD"),
        thesis_sizes=(200, 200),
    ),
    KnownDataset(
        "synthia",
        "SYNTHIA",
        "Ros, Sellart, Materzynska, Vazquez, Lopez: The SYNTHIA Dataset, CVPR 2016",
        licence="CC BY-NC-SA 3.0",
        folders=("SYNTHIA", "Synthia-NightToFall"),
        thesis_sizes=(200, 200),
    ),
    KnownDataset(
        "17_places",
        "17 places",
        "Sahdev, Tsotsos: Indoor Place Recognition System for Localization of Mobile Robots, "
        "Conference on Computer and Robot Vision, 2016",
        folders=("17places", "17Places"),
        query=("day_vme1", "query"),
        reference=("night_vme1", "ref", "reference"),
        thesis_sizes=(457, 434),
        note="chapter 6 takes 420 + 420 of them",
    ),
    KnownDataset(
        "alderley",
        "Alderley",
        "Milford, Wyeth: SeqSLAM: Visual route-based navigation for sunny summer days and stormy "
        "winter nights, ICRA 2012",
        folders=("Alderley",),
        query=("night", "query"),
        reference=("day", "ref", "reference"),
        thesis_sizes=(201, 201),
    ),
    KnownDataset(
        "sped",
        "SPED",
        "Chen, Jacobson, Sünderhauf, Upcroft, Liu, Shen, Reid, Milford: Deep Learning Features at "
        "Scale for Visual Place Recognition, ICRA 2017",
        folders=("SPED", "SPEDTEST"),
        tolerance_frames=0,
        thesis_sizes=(607, 607),
        note="places seen by fixed cameras, not a drive: query i shows place i alone",
    ),
)
