"""Holds our FLIP against NVIDIA's own tool (PyPI: flip-evaluator) on pictures that `anisomap chart --pictures` wrote.

    compare_flip.py DIR    DIR is what was given to chart

Both see the same 8-bit PNG files. Compared are the mean (pictures.csv) and every pixel (the 16-bit maps beside the
pictures); the largest difference allowed is 1e-3.
"""

import csv
import pathlib
import sys

import flip_evaluator
import numpy
from PIL import Image

ALLOWED = 1e-3
# The paper's observer, as `analyse::PIXELS_PER_DEGREE` states it.
PIXELS_PER_DEGREE = 67.02064


def picture(path):
    return numpy.asarray(Image.open(path).convert("RGB"), numpy.float32) / 255


def main(folder):
    rows = list(csv.DictReader(open(folder / "pictures.csv", newline="")))
    worst_mean = worst_pixel = 0.0
    for row in rows:
        name = row["scene"].replace(" ", "-") + "-reference.png"
        reference = picture(folder / "pictures" / name)
        test = picture(folder / row["png"])
        theirs, mean, _ = flip_evaluator.evaluate(
            reference, test, "LDR", inputsRGB=True, applyMagma=False, parameters={"ppd": PIXELS_PER_DEGREE}
        )
        stored = folder / row["png"].replace(".png", "-flip.png")
        ours = numpy.asarray(Image.open(stored), numpy.float64) / 65535
        worst_mean = max(worst_mean, abs(mean - float(row["png_flip_mean"])))
        worst_pixel = max(worst_pixel, numpy.abs(theirs.reshape(ours.shape) - ours).max())
    print(f"{len(rows)} pictures: means differ by at most {worst_mean:.1e}, pixels by at most {worst_pixel:.1e}")
    if len(rows) < 50:
        sys.exit("fewer pictures than a chart has")
    if max(worst_mean, worst_pixel) > ALLOWED:
        sys.exit(f"FLIP is farther from NVIDIA's than {ALLOWED}")


main(pathlib.Path(sys.argv[1]))
