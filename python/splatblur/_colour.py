"""Values of any column as colours."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from . import _arrays
from ._errors import invalid
from ._frame import srgb_to_linear

# 33 colours at even distances, sRGB, of the maps that matplotlib has by these names (van der Walt and Smith 2015, CC0;
# cividis by Nunez et al. 2018, turbo by Mikhailov 2019, coolwarm by Moreland 2009).
_MAPS = {
    "viridis": (
        "440154470d6048186a482374472d7b4537814240863e49893b528b375b8d33638d2f6b8e2c728e297a8e26828e23898e"
        "21918c1f988b1fa08822a78528ae8032b67a3fbc734ec36b5ec96270cf5784d44b98d83eaddc30c2df23d8e219ece51b"
        "fde725"
    ),
    "plasma": (
        "0d08872206903105973f049c4c02a15901a56600a77201a87e03a88a09a59511a1a01a9caa2395b32c8ebc3587c43e7f"
        "cc4778d35171da5a6ae06363e66c5ceb7655f0804ef58b47f89540fba139fdac33feb82cfdc527fcd225f8df25f4ed27"
        "f0f921"
    ),
    "inferno": (
        "0000040403120b0724150b37210c4a2f0a5b3d09654a0c6b57106e64156e71196e7d1e6d8a226a972766a32c61b0315b"
        "bc3754c73e4cd24644db503be45a31eb6628f1731df68013f98e09fb9d07fcac11fbbc21f9cb35f5db4cf2ea69f3f68a"
        "fcffa4"
    ),
    "magma": (
        "0000040303120a0822130d341d114729115a36106b440f7651127c5d177f6a1c81762181832681902a819c2e7faa337d"
        "b73779c43c75d0416fdc4869e75263ef5d5ef56b5cf9795dfc8961fd9869fea772feb67cfec488fed395fde2a3fcf0b2"
        "fcfdbf"
    ),
    "cividis": (
        "00224e00285b002e6a0533711a386f273e6e32436d3b496c434e6c4b546c535a6d5a5f6e61656f686a716f7073767676"
        "7d7c788482798c8878938e789b9476a39a74aba072b4a76fbcae6cc4b468cdbb63d5c25edec958e7d150f0d846f9e03a"
        "fee838"
    ),
    "turbo": (
        "30123b392a734040a24456c7466be34680f64294ff37a8fa28bceb1ccdd818ddc21fe9af32f2984ef97d6dfe628bff4b"
        "a4fc3cb9f635cdec34dfdf37eecf3af8be39fdac34fe962bfb7e21f46617eb500edf3f08d02f05be2102a91601920b01"
        "7a0403"
    ),
    "coolwarm": (
        "3b4cc0445acc4e68d85875e16282ea6c8ff1779af782a6fb8db0fe98b9ffa3c2feaec9fcb9d0f9c3d5f4ccd9edd5dbe5"
        "dddcdce5d8d1ecd3c5f1ccb8f5c4acf7ba9ff7b093f6a586f4987af08b6eeb7d62e46e56dd5f4bd44e41ca3b37be242e"
        "b40426"
    ),
    "gray": "000000ffffff",
    "grey": "000000ffffff",
}


def colour_map(
    values: npt.ArrayLike,
    name: str = "viridis",
    range: tuple[float, float] | None = None,
    *,
    missing: npt.ArrayLike = 0.2,
) -> npt.NDArray[np.float64]:
    """Colours of values, for `Points(colors=...)`.

    Args:
        values: Numbers of any shape.
        name: `viridis`, `plasma`, `inferno`, `magma`, `cividis`, `turbo`, `coolwarm` or `gray`.
        range: The values of the first and of the last colour; what is beyond has those. The default is the least and
            the greatest finite value.
        missing: Linear colour of what is not a number.

    Returns:
        Linear Rec.709 colours, with a last axis of 3.

    Raises:
        InvalidValue: There is no such map, or the range is not two finite numbers that rise.
    """
    if name not in _MAPS:
        raise invalid("name", f"{name!r}"[:200], f"a map ({', '.join(_MAPS)})")
    array = _arrays.real(values, "values").astype(np.float64)
    finite = array[np.isfinite(array)]
    if range is None:
        low, high = (float(np.min(finite)), float(np.max(finite))) if finite.size else (0.0, 1.0)
    else:
        low, high = (_arrays.number(bound, "range") for bound in range)
        if not (np.isfinite([low, high]).all() and low < high):
            raise invalid("range", f"{range!r}"[:200], "two finite numbers, the first of which is less")
    knots = np.frombuffer(bytes.fromhex(_MAPS[name]), np.uint8).reshape(-1, 3) / 255.0
    # In halves, so that the widest range does not overflow.
    width = 0.5 * high - 0.5 * low
    share = np.clip((0.5 * array - 0.5 * low) / width, 0.0, 1.0) if width > 0.0 else np.full(array.shape, 0.5)
    places = np.linspace(0.0, 1.0, len(knots))
    known = np.where(np.isnan(array), 0.0, share)
    coded = np.stack([np.interp(known, places, knots[:, channel]) for channel in (0, 1, 2)], axis=-1)
    colours = srgb_to_linear(coded)
    colours[np.isnan(array)] = _arrays.colour(missing, "missing")
    return colours


color_map = colour_map
