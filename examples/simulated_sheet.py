"""One sheet of pictures: places of a simulated street under one disturbance after another.

    python examples/simulated_sheet.py sheet.jpg

makes the picture of docs/simulator.md.
"""

# ruff: noqa: T201 -- printing is what an example is for
import argparse
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from retraverse.datasets.simulated import Disturbances, simulate_route

LOOKS = {
    "reference": Disturbances(),
    "season 1": Disturbances(season=1.0),
    "night 0.5": Disturbances(night=0.5),
    "night 1": Disturbances(night=1.0),
    "fog 0.6, rain 0.7": Disturbances(fog=0.6, rain=0.7),
    "lateral_shift 1, traffic 1": Disturbances(lateral_shift=1.0, traffic=1.0),
}
WIDTH, HEIGHT, GAP, HEAD = 198, 149, 3, 22


def main() -> None:
    """Render the sheet."""
    parser = argparse.ArgumentParser(description="a sheet of simulated pictures")
    parser.add_argument("out", type=Path, help="a .jpg or .png file")
    parser.add_argument("--places", type=int, default=4, help="rows")
    parser.add_argument("--columns", type=int, default=len(LOOKS))
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    looks = list(LOOKS.items())[: options.columns]
    size = (len(looks) * (WIDTH + GAP) - GAP, HEAD + options.places * (HEIGHT + GAP))
    sheet = Image.new("RGB", size, "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(13)
    for column, (label, look) in enumerate(looks):
        left = column * (WIDTH + GAP)
        draw.text((left + 4, 3), label, fill="black", font=font)
        drive = simulate_route(options.seed, 30 * options.places, query=look).query
        for row in range(options.places):
            picture = Image.fromarray(drive[30 * row + 10]).resize((WIDTH, HEIGHT))
            sheet.paste(picture, (left, HEAD + row * (HEIGHT + GAP)))
    sheet.save(options.out, quality=88)
    print(f"{options.out}: {size[0]} x {size[1]} pixels")


if __name__ == "__main__":
    main()
