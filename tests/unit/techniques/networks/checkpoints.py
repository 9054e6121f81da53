"""Names and shapes in the official checkpoints, written down from their authors' code.

Sources: CosPlace's and EigenPlaces' ``GeoLocalizationNet`` (torchvision's backbones in a
``Sequential``, so numbered), MixVPR's and SALAD's ``VPRModel``, BoQ's and MegaLoc's hub files,
DINOv2's ``DinoVisionTransformer``. Nothing here asks the networks under test.
"""

from collections.abc import Iterator

import numpy as np

from retraverse.types import Array

Shapes = dict[str, tuple[int, ...]]

BLOCKS = {18: (2, 2, 2, 2), 50: (3, 4, 6, 3), 101: (3, 4, 23, 3), 152: (3, 8, 36, 3)}
VGG16_CONVOLUTIONS = {
    0: (64, 3), 2: (64, 64), 5: (128, 64), 7: (128, 128), 10: (256, 128), 12: (256, 256),
    14: (256, 256), 17: (512, 256), 19: (512, 512), 21: (512, 512), 24: (512, 512),
    26: (512, 512), 28: (512, 512),
}  # fmt: skip
"""Place in torchvision's ``vgg16().features`` -> channels out and in."""


def _norm(name: str, width: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    for part in ("weight", "bias", "running_mean", "running_var"):
        yield f"{name}.{part}", (width,)
    yield f"{name}.num_batches_tracked", ()


def _linear(name: str, outputs: int, inputs: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    yield f"{name}.weight", (outputs, inputs)
    yield f"{name}.bias", (outputs,)


def _pointwise(name: str, outputs: int, inputs: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    yield f"{name}.weight", (outputs, inputs, 1, 1)
    yield f"{name}.bias", (outputs,)


def resnet(prefix: str, depth: int, *, numbered: bool, n_stages: int = 4) -> Shapes:
    """Return a ResNet under torchvision's names, or numbered as children of a Sequential."""
    deep = depth >= 50
    conv1, bn1 = ("0", "1") if numbered else ("conv1", "bn1")
    shapes: Shapes = {f"{prefix}.{conv1}.weight": (64, 3, 7, 7)}
    shapes.update(_norm(f"{prefix}.{bn1}", 64))
    inputs = 64
    for stage, width in enumerate((64, 128, 256, 512)[:n_stages]):
        name = f"{prefix}.{4 + stage}" if numbered else f"{prefix}.layer{1 + stage}"
        outputs = width * 4 if deep else width
        for block in range(BLOCKS[depth][stage]):
            here = f"{name}.{block}"
            kernels = (1, 3, 1) if deep else (3, 3)
            widths = (width, width, outputs) if deep else (width, width)
            before = inputs
            for number, (kernel, after) in enumerate(zip(kernels, widths, strict=True), 1):
                shapes[f"{here}.conv{number}.weight"] = (after, before, kernel, kernel)
                shapes.update(_norm(f"{here}.bn{number}", after))
                before = after
            if block == 0 and (stage or deep):
                shapes[f"{here}.downsample.0.weight"] = (outputs, inputs, 1, 1)
                shapes.update(_norm(f"{here}.downsample.1", outputs))
            inputs = outputs
    return shapes


def vgg16(prefix: str) -> Shapes:
    shapes: Shapes = {}
    for place, (outputs, inputs) in VGG16_CONVOLUTIONS.items():
        shapes[f"{prefix}.{place}.weight"] = (outputs, inputs, 3, 3)
        shapes[f"{prefix}.{place}.bias"] = (outputs,)
    return shapes


def dinov2(prefix: str, width: int = 768, depth: int = 12, grid: int = 37) -> Shapes:
    shapes: Shapes = {
        f"{prefix}.cls_token": (1, 1, width),
        f"{prefix}.pos_embed": (1, grid * grid + 1, width),
        f"{prefix}.mask_token": (1, width),
        f"{prefix}.patch_embed.proj.weight": (width, 3, 14, 14),
        f"{prefix}.patch_embed.proj.bias": (width,),
    }
    for block in range(depth):
        name = f"{prefix}.blocks.{block}"
        for norm in ("norm1", "norm2"):
            shapes |= {f"{name}.{norm}.weight": (width,), f"{name}.{norm}.bias": (width,)}
        shapes |= {f"{name}.ls1.gamma": (width,), f"{name}.ls2.gamma": (width,)}
        shapes.update(_linear(f"{name}.attn.qkv", 3 * width, width))
        shapes.update(_linear(f"{name}.attn.proj", width, width))
        shapes.update(_linear(f"{name}.mlp.fc1", 4 * width, width))
        shapes.update(_linear(f"{name}.mlp.fc2", width, 4 * width))
    return shapes | {f"{prefix}.norm.weight": (width,), f"{prefix}.norm.bias": (width,)}


def geo(backbone: str, dimension: int) -> Shapes:
    """Return CosPlace's and EigenPlaces' ``{backbone}_{dimension}_….pth``."""
    if backbone == "VGG16":
        shapes, channels = vgg16("backbone"), 512
    else:
        depth = int(backbone.removeprefix("ResNet"))
        shapes = resnet("backbone", depth, numbered=True)
        channels = 2048 if depth >= 50 else 512
    shapes["aggregation.1.p"] = (1,)
    shapes.update(_linear("aggregation.3", dimension, channels))
    return shapes


def mixvpr(out_channels: int, out_rows: int) -> Shapes:
    """Return MixVPR's ``resnet50_MixVPR_….ckpt``."""
    shapes = resnet("backbone.model", 50, numbered=False, n_stages=3)
    for layer in range(4):
        name = f"aggregator.mix.{layer}.mix"
        shapes |= {f"{name}.0.weight": (400,), f"{name}.0.bias": (400,)}
        shapes.update(_linear(f"{name}.1", 400, 400))
        shapes.update(_linear(f"{name}.3", 400, 400))
    shapes.update(_linear("aggregator.channel_proj", out_channels, 1024))
    shapes.update(_linear("aggregator.row_proj", out_rows, 400))
    return shapes


def _aggregator(prefix: str, width: int, cluster_length: int) -> Shapes:
    shapes: Shapes = {f"{prefix}.dust_bin": ()}
    shapes.update(_linear(f"{prefix}.token_features.0", 512, width))
    shapes.update(_linear(f"{prefix}.token_features.2", 256, 512))
    for name, outputs in (("cluster_features", cluster_length), ("score", 64)):
        shapes.update(_pointwise(f"{prefix}.{name}.0", 512, width))
        shapes.update(_pointwise(f"{prefix}.{name}.3", outputs, 512))
    return shapes


def salad(width: int = 768, depth: int = 12, grid: int = 37) -> Shapes:
    """Return SALAD's ``dino_salad.ckpt``."""
    return dinov2("backbone.model", width, depth, grid) | _aggregator("aggregator", width, 128)


def megaloc(width: int = 768, depth: int = 12, grid: int = 37, dimension: int = 8448) -> Shapes:
    """Return MegaLoc's ``megaloc.torch``."""
    shapes = dinov2("backbone.model", width, depth, grid)
    shapes |= _aggregator("aggregator.agg", width, 256)
    shapes.update(_linear("aggregator.linear", dimension, 64 * 256 + 256))
    return shapes


def megaloc_safetensors(width: int, depth: int, grid: int, dimension: int) -> Shapes:
    """Return the later release, whose DINOv2 is its own: no ``model.``, no mask token."""
    return {
        name.replace("backbone.model.", "backbone."): shape
        for name, shape in megaloc(width, depth, grid, dimension).items()
        if not name.endswith("mask_token")
    }


def boq(backbone: str, dino: tuple[int, int, int] = (768, 12, 37)) -> Shapes:
    """Return BoQ's ``resnet50_16384.pth`` or ``dinov2_12288.pth``."""
    if backbone == "resnet50":
        shapes = resnet("backbone.net", 50, numbered=True, n_stages=3)
        channels, width = 1024, 512
    else:
        shapes, channels, width = dinov2("backbone.dino", *dino), dino[0], 384
    shapes |= {
        "aggregator.proj_c.weight": (width, channels, 3, 3),
        "aggregator.proj_c.bias": (width,),
        "aggregator.norm_input.weight": (width,),
        "aggregator.norm_input.bias": (width,),
    }
    for bag in range(2):
        name = f"aggregator.boqs.{bag}"
        shapes[f"{name}.queries"] = (1, 64, width)
        for attention in ("encoder.self_attn", "self_attn", "cross_attn"):
            shapes[f"{name}.{attention}.in_proj_weight"] = (3 * width, width)
            shapes[f"{name}.{attention}.in_proj_bias"] = (3 * width,)
            shapes.update(_linear(f"{name}.{attention}.out_proj", width, width))
        shapes.update(_linear(f"{name}.encoder.linear1", 4 * width, width))
        shapes.update(_linear(f"{name}.encoder.linear2", width, 4 * width))
        for norm in ("encoder.norm1", "encoder.norm2", "norm_q", "norm_out"):
            shapes |= {f"{name}.{norm}.weight": (width,), f"{name}.{norm}.bias": (width,)}
    shapes.update(_linear("aggregator.fc", 32, 128))
    return shapes


def seeded(shapes: Shapes, seed: int = 0) -> dict[str, Array]:
    """Return arrays of these shapes that a network stays well-behaved with."""
    # One stretch of noise, of prime length, over and over: drawing millions anew takes long.
    noise = np.random.default_rng(seed).standard_normal(1_000_003, dtype=np.float32)
    return {name: _values(name, shape, noise) for name, shape in shapes.items()}


def _values(name: str, shape: tuple[int, ...], noise: Array) -> Array:
    if name.endswith("num_batches_tracked"):
        return np.array(7, np.int64)
    if name.endswith(".p"):
        return np.array([3.0], np.float32)
    start = sum(name.encode()) * 7 % 500_000
    values = np.resize(noise[start:], shape)
    if name.endswith("running_var") or (name.endswith(("weight", "gamma")) and len(shape) == 1):
        return np.asarray(1 + 0.1 * np.abs(values), np.float32)
    fan = max(1, int(np.prod(shape[1:])))
    return np.asarray(values * np.sqrt(2 / fan) if len(shape) > 1 else 0.1 * values, np.float32)
