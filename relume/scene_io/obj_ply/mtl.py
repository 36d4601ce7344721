"""Material libraries of OBJ files: numbers and images by keyword.

Wavefront's Material Library File format, and its common PBR extension.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning
from relume.scene_io.obj_ply.mtl_dialects import MtlMap, MtlMaterial, detect_dialect
from relume.scene_io.obj_ply.text import Faults, counted, decode_text, number, plain_lines, strip_comment

MAX_LIBRARY_BYTES = 8 << 20
MAX_MATERIALS = 1_000
MAX_NUMBER = 1e6
NUMBERS = {"Kd": 3, "Ks": 3, "Ke": 3, "Ns": 1, "Pr": 1, "Pm": 1, "d": 1, "Tr": 1}
NUMBERS |= {"Ka": 3, "Tf": 3, "Ni": 1, "illum": 1, "Pc": 1, "Pcr": 1, "Ps": 1, "aniso": 1}
NORMAL_MAP_KEYWORDS = ("norm", "map_Bump")
USED_MAPS = ("map_Kd", "map_Ks", "map_Ke", "map_d", "map_Pr", *NORMAL_MAP_KEYWORDS)
OTHER_MAPS = ("map_Ka", "map_aat", "disp", "refl")
SPELLINGS = {keyword.lower(): keyword for keyword in (*NUMBERS, *USED_MAPS, *OTHER_MAPS)}
SPELLINGS |= {"bump": "map_Bump", "map_kn": "norm", "map_norm": "norm"}
"""Keywords by their lower case: programs differ."""
OPTIONS = {"-blendu": 1, "-blendv": 1, "-boost": 1, "-mm": 2, "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-clamp": 1}
OPTIONS |= {"-bm": 1, "-imfchan": 1, "-type": 1, "-cc": 1, "-colorspace": 1}
"""Largest number of arguments; of those with three, v and w may be missing."""
DEFAULTS: dict[str, Sequence[list[Any]]] = {
    "-mm": ([0.0, 1.0],),
    "-t": ([0.0] * 3,),
    "-cc": (["off"],),
    "-colorspace": (["srgb"], ["linear"], ["raw"]),
}
"""Arguments of unsupported options that change nothing; those of all others never do."""
FILLS = {"-s": 1.0, "-o": 0.0, "-t": 0.0}


def read_library(data: bytes, folder: str, warnings: list[ImporterWarning]) -> dict[str, MtlMaterial]:
    """Read the materials of a library by name; numbers that cannot be used are left out.

    Args:
        data: the file. folder: of the library, relative to the scene.
        warnings: gets one sentence for all numbers that were left out.
    Raises:
        SceneError: too large, or too many materials.
    """
    if len(data) > MAX_LIBRARY_BYTES:
        raise SceneError(f"the material file is larger than {MAX_LIBRARY_BYTES >> 20} MB; export it again")
    materials: dict[str, MtlMaterial] = {}
    lines = decode_text(plain_lines(data)).split("\n")
    dialect = detect_dialect(lines)
    material = MtlMaterial(dialect=dialect)
    faults = Faults()
    for line_number, line in enumerate(lines, 1):
        written, arguments = (*line.split(maxsplit=1), "", "")[:2]
        keyword = SPELLINGS.get(written.lower(), written)
        if keyword == "newmtl":
            material = materials[strip_comment(arguments)[:1_000]] = MtlMaterial(folder, dialect)
            if len(materials) > MAX_MATERIALS:
                raise SceneError(f"the material file has more than {MAX_MATERIALS:,} materials; remove some")
        elif keyword in NUMBERS:
            try:
                material.numbers[keyword] = _numbers(strip_comment(arguments).split(), NUMBERS[keyword])
            except ValueError:
                faults.add(f"line {line_number:,}", line)
        elif keyword.lower().startswith("map_") or keyword in (*USED_MAPS, *OTHER_MAPS):
            material.maps[keyword] = parse_map(strip_comment(arguments).split())
    warnings.extend(
        faults.warnings(f"Left out {counted(faults.count, 'value')} of the material file that cannot be used:")
    )
    return materials


def _numbers(tokens: list[str], count: int) -> list[float]:
    """Parse `count` numbers; a single number is used for all channels. Raises ValueError if they cannot be used."""
    values = [number(token) for token in tokens[:count]]
    if len(values) == 1:
        values *= count
    if len(values) != count or not np.isfinite(values).all() or not 0 <= min(values) <= max(values) <= MAX_NUMBER:
        raise ValueError("out of range")
    return values


def parse_map(tokens: Sequence[str]) -> MtlMap:
    """Parse the line of an image: its name, which may contain spaces, and options before or after it."""
    name: list[str] = []
    options: dict[str, list[Any]] = {}
    k = 0
    while k < len(tokens):
        option, k = tokens[k].lower(), k + 1
        if option not in OPTIONS:
            name.append(tokens[k - 1])
            continue
        if option in FILLS or option == "-mm":
            values = _leading_numbers(tokens[k : k + OPTIONS[option]])
            k += len(values)
            options[option] = values + [FILLS.get(option, 1.0)] * (OPTIONS[option] - len(values))
        elif option == "-bm":
            options[option] = [*_leading_numbers(tokens[k : k + 1]), 1.0]
            k += 1
        else:
            options[option] = [token.lower() for token in tokens[k : k + 1]]
            k += 1
    scale, offset = options.get("-s", [1.0, 1.0]), options.get("-o", [0.0, 0.0])
    channel = (*options.get("-imfchan", []), "")[0]
    return MtlMap(
        " ".join(name).strip('"')[:1_000],
        (scale[0], scale[1]),
        (offset[0], offset[1]),
        options.get("-bm", [1.0])[0],
        options.get("-clamp") == ["on"],
        channel if channel in ("r", "g", "b", "m", "l") else "",
        tuple(option for option in sorted(options) if options[option] not in DEFAULTS.get(option, (options[option],))),
    )


def _leading_numbers(tokens: Sequence[str]) -> list[float]:
    """The finite numbers before the first other word."""
    values: list[float] = []
    for token in tokens:
        try:
            value = float(token)
        except ValueError:
            break
        values.append(value if abs(value) <= MAX_NUMBER else 1.0)
    return values
