#!/usr/bin/env python3
"""Makes the fonts of the window from the fonts of the Debian packages fonts-inter and fonts-noto-cjk.

    python3 -m venv venv && venv/bin/pip install fonttools
    venv/bin/python subset.py /usr/share/fonts/opentype

Latin: Inter, with the digits of equal width (feature tnum) in place of the usual ones, because the window is full of
numbers that change. Chinese: Noto Sans CJK SC, the characters of GB 2312, which covers modern technical prose. Hinting
and the layout tables that nothing here uses are left out.
"""

import sys
from pathlib import Path

from fontTools import subset
from fontTools.ttLib import TTFont

HERE = Path(__file__).parent

# Letters of Western Europe, Greek for mathematics, and the signs that the window uses.
LATIN = [
    *range(0x0020, 0x007F),
    *range(0x00A0, 0x0180),
    *range(0x0391, 0x03CA),
    *(ord(sign) for sign in "\u2007\u2009\u202f–—‘’‚“”„†•…′″‹›⁄€™−×÷±≈≠≤≥∞∂∆∏∑√∫°µΩ←↑→↓↔↕↖↗↘↙⇧⌘⌥⌃⏎⌫␣▲▼◀▶●○■□✓✗✕★☆⋯⁰¹²³⁴⁵⁶⁷⁸⁹₀₁₂₃₄₅₆₇₈₉"),
]


def gb2312():
    """Every character of GB 2312: signs in rows 1 to 9, Chinese in rows 16 to 87."""
    for row in [*range(0xA1, 0xAA), *range(0xB0, 0xF8)]:
        for cell in range(0xA1, 0xFF):
            try:
                yield ord(bytes([row, cell]).decode("gb2312"))
            except UnicodeDecodeError:
                pass


def options(features):
    chosen = subset.Options()
    chosen.layout_features = features
    chosen.hinting = False
    chosen.notdef_outline = True
    chosen.name_IDs = [0, 1, 2, 3, 4, 5, 6, 13, 14]
    chosen.drop_tables += ["BASE", "VORG", "vhea", "vmtx", "DSIG", "meta", "STAT"]
    return chosen


def equal_digits(font):
    """Puts the figures of equal width in the place of those of the character map."""
    gsub = font["GSUB"].table
    lookups = {i for record in gsub.FeatureList.FeatureRecord if record.FeatureTag == "tnum"
               for i in record.Feature.LookupListIndex}
    mapping = {}
    for index in lookups:
        for table in gsub.LookupList.Lookup[index].SubTable:
            mapping.update(getattr(getattr(table, "ExtSubTable", table), "mapping", {}))
    wanted = [ord(sign) for sign in "0123456789+−.:±"]
    for table in font["cmap"].tables:
        for code in wanted:
            if code in table.cmap and table.cmap[code] in mapping:
                table.cmap[code] = mapping[table.cmap[code]]


def same_baseline(font, ascent, descent):
    """Gives a font the ascent and descent (shares of the size) of the Latin one: what mixes fonts centres their boxes,
    and baselines meet only when the boxes are alike."""
    units = font["head"].unitsPerEm
    ascent, descent = round(ascent * units), round(descent * units)
    font["hhea"].ascent, font["hhea"].descent, font["hhea"].lineGap = ascent, -descent, 0
    font["OS/2"].sTypoAscender, font["OS/2"].sTypoDescender, font["OS/2"].sTypoLineGap = ascent, -descent, 0
    font["OS/2"].usWinAscent, font["OS/2"].usWinDescent = ascent, descent


def write(font, codes, features, name):
    subsetter = subset.Subsetter(options(features))
    subsetter.populate(unicodes=codes)
    subsetter.subset(font)
    target = HERE / name
    font.save(target)
    print(f"{target.name}: {len(font.getGlyphOrder())} glyphs, {target.stat().st_size / 1e6:.2f} MB")


def main(fonts):
    for weight in ["Regular", "SemiBold"]:
        font = TTFont(fonts / "inter" / f"Inter-{weight}.otf")
        equal_digits(font)
        # The figure space pads numbers and has to be as wide as a digit.
        cmap = font.getBestCmap()
        font["hmtx"][cmap[0x2007]] = (font["hmtx"][cmap[ord("0")]][0], 0)
        units = font["head"].unitsPerEm
        box = (font["hhea"].ascent / units, -font["hhea"].descent / units)
        write(font, LATIN, ["kern", "ccmp", "mark", "locl"], f"Inter-{weight}-subset.otf")
    # Number 2 of the collection is the one with Simplified Chinese forms.
    font = TTFont(fonts / "noto" / "NotoSansCJK-Regular.ttc", fontNumber=2)
    assert font["name"].getDebugName(4) == "Noto Sans CJK SC", font["name"].getDebugName(4)
    same_baseline(font, *box)
    latin = set(range(0x20, 0x17F))
    write(font, [code for code in gb2312() if code not in latin], [], "NotoSansSC-Regular-subset.otf")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "/usr/share/fonts/opentype"))
