"""What a part of a model does to sight: occluder, detail or transparent, by what its file says or by its names.

What a file says of materials comes first, then IFC classes, names last. Classes are tested by inheritance: a test for
the exact name once made every `IfcSlabStandardCase` transparent. Names are compared by whole words, in the languages
that exporters write, with accents, case and joints (`FrontDoor`, `Glas_klar`) taken away.
"""

import re
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from ..errors import InputError
from ..scene import Role

SEE_THROUGH = ("IfcWindow", "IfcCurtainWall")
BUILDING = ("IfcBuildingElement", "IfcBuiltElement")
# Elements of a building that are furniture to a visibility solver: they block rays and shape no cells.
ACCESSORIES = ("IfcFurnishingElement", "IfcElementComponent", "IfcBuildingElementPart", "IfcShadingDevice")
# Whole words, in English, German, French, Italian, Spanish, Dutch, Danish, Norwegian, Swedish and Finnish; accents off.
GLASS = frozenset(
    "glass glasses glazed glazing glazings pane panes translucent transparent transparency "
    "glas glaser glaeser verglasung verglasungen verglast scheibe durchsichtig transluzent "
    "verre verres vitre vitres vitree vitrage vitrages vitrail "
    "vetro vetri vetrata vetrate vetrato trasparente "
    "vidrio vidrios cristal cristales acristalamiento transparente "
    "beglazing ruit ruiten doorzichtig "
    "glassfelt glaset glassrute glasruta ruta rude ruder lasi lasit".split()
)
WINDOW = frozenset(
    "window windows skylight skylights rooflight "
    "fenster fensterflugel oberlicht oberlichter "
    "fenetre fenetres lucarne "
    "finestra finestre lucernario "
    "ventana ventanas claraboya "
    "raam ramen venster vensters dakraam "
    "vindue vinduer vindu vinduet fonster fonstret ikkuna ikkunat".split()
)
# Beside a word for glass these make it insulation or reinforcement, through which nobody sees.
NO_GLASS = frozenset(
    "wool fibre fibres fiber fibers fibreglass fiberglass foam foamed foamglas foamglass cellular cellglas reinforced "
    "wolle faser fasern schaumglas schaum gewebe vlies laine fibra fibras lana lane vezel vezels wol uld ull kuitu "
    "villa".split()
)
# Layers between panes.
AIR = frozenset(
    "air luft luftschicht luftraum hohlraum scheibenzwischenraum aire aria lucht luchtspouw spouw lame ilma gap cavity "
    "argon krypton xenon gas gaz vide vuoto vacuum".split()
)
DOOR = frozenset(
    "door doors doorleaf "
    "tur turen tuer tueren ture turblatt tor "
    "porte portes "
    "porta "
    "puerta puertas "
    "deur deuren "
    "dor dore dorr dorrar dorer ovi ovet".split()
)
# Compounds, which German, Dutch and Nordic write in one word; "Natur" ends in no door, "Glasgow" begins with no glass.
GLASS_COMPOUND = re.compile(
    r".(glas|glass|verglasung|fenster|fönster|vindu|vindue|venster)$|"
    r"^glass?(wand|wände|tür|türe|türen|trennwand|fassade|dach|scheibe|fläche|wall|door|panel|partition|front|"
    r"parti|vägg|vegg|væg|dør|dörr|deur|gevel|dak)$"
)
DOOR_COMPOUND = re.compile(r".(tür|türe|türen|tuer|tueren|dörr|dør|deur|deuren)$")
FURNITURE = re.compile(
    r"furnitur|furnish|möbel|chair|stuhl|table|tisch|desk|sofa|couch|bench|shelf|shelves|cabinet|cupboard|wardrobe|"
    r"bed\b|lamp|plant|toilet|\bwc\b|sink|basin|bath|shower|heater|radiator|monitor|computer",
    re.IGNORECASE,
)
DOOR_CHOICES = ("open", "closed")
# 8 bits a channel: anything the author made less than fully opaque.
OPAQUE_ALPHA = 254 / 255
# Letters that lose no accent when decomposed.
PLAIN = str.maketrans({"ø": "o", "æ": "ae", "ß": "ss", "œ": "oe", "ł": "l", "đ": "d"})


@dataclass(frozen=True)
class Taken:
    """What a part was taken for.

    Attributes:
        kind: IFC class, or "Mesh".
        why: by what it was taken for glass or a door; empty for the rest.
    """

    role: Role
    kind: str
    why: str = ""


@dataclass(frozen=True)
class RoleRules:
    """How roles are told; patterns are regular expressions, looked for anywhere, whatever the case.

    Attributes:
        doors: "open" (doors are transparent) or "closed" (they occlude).
        glass: in place of the words for glass and windows: what it finds in "name" or "material" is transparent.
        doors_by: in place of the words for doors.
        leave_out: parts whose name, GUID or kind it finds are not read.

    Raises:
        InputError: `doors` is neither, or a pattern is no regular expression.
    """

    doors: str = "open"
    glass: str = ""
    doors_by: str = ""
    leave_out: str = ""

    def __post_init__(self) -> None:
        if self.doors not in DOOR_CHOICES:
            raise InputError(f"doors: expected open or closed, found {self.doors!r}")
        for what in ("glass", "doors_by", "leave_out"):
            try:
                re.compile(getattr(self, what))
            except re.error as error:
                what_it_is = f"{what.replace('_', '-')}: expected a regular expression"
                raise InputError(f"{what_it_is}, found {getattr(self, what)!r}: {error}") from None

    @property
    def door(self) -> Role:
        """The role of doors."""
        return Role.OCCLUDER if self.doors == "closed" else Role.TRANSPARENT

    def leaves_out(self, *texts: str) -> bool:
        """Whether one of a part's name, GUID and kind is to be left out."""
        return bool(self.leave_out) and any(re.search(self.leave_out, text, re.IGNORECASE) for text in texts)

    def of_product(
        self,
        is_a: Callable[[str], bool],
        name: str,
        kind: str,
        *,
        in_curtain_wall: bool = False,
        glazed: str = "",
        by_words: bool = True,
    ) -> Taken:
        """Role of an IFC product.

        Args:
            is_a: whether the product's class is, or inherits from, the class of that name.
            name: the product's name and its type's: glass if it says so, and to tell proxies of furniture.
            kind: its class.
            in_curtain_wall: it is a part of a curtain wall, whose plates are panes.
            glazed: by which of its materials one sees through it; empty if none is known.
            by_words: whether words for glass in its name count, where its class does not say glass.
        """
        if glazed:
            return Taken(Role.TRANSPARENT, kind, glazed)
        if is_a("IfcDoor"):
            return Taken(self.door, kind, f"door: class {kind}")
        if any(map(is_a, SEE_THROUGH)):
            return Taken(Role.TRANSPARENT, kind, f"glass: class {kind}")
        if in_curtain_wall and is_a("IfcPlate"):
            return Taken(Role.TRANSPARENT, kind, "glass: a plate of a curtain wall")
        if self.glass and (why := self.named_glass(name, "name")):
            return Taken(Role.TRANSPARENT, kind, why)
        if self.doors_by and (why := self.named_door(name)):
            return Taken(self.door, kind, why)
        # A proxy's class says nothing, so its name may say window or door; other classes say that they are neither.
        proxy = is_a("IfcBuildingElementProxy")
        if by_words and (why := self.named_glass(name, "name" if proxy else "product name")):
            return Taken(Role.TRANSPARENT, kind, why)
        if by_words and proxy and (why := self.named_door(name)):
            return Taken(self.door, kind, why)
        if any(map(is_a, ACCESSORIES)) or not any(map(is_a, BUILDING)):
            return Taken(Role.DETAIL, kind)
        if proxy and FURNITURE.search(name):
            return Taken(Role.DETAIL, kind)
        return Taken(Role.OCCLUDER, kind)

    def of_mesh(self, name: str, material: str, see_through: str = "") -> Taken:
        """Role of a part of a mesh file.

        Args:
            name: its own name; one that holds an IFC class, such as `12|IfcDoor|Exit`, is judged by that class.
            material: its material's name.
            see_through: by what its material lets light pass, in words; empty if it does not say so.
        """
        kind = named_class(name) or "Mesh"
        if why := see_through or self.named_glass(material, "material"):
            return Taken(Role.TRANSPARENT, kind, why if why.startswith("glass") else f"glass: {why}")
        if kind != "Mesh":
            return self.of_product(_ancestors(kind).__contains__, name, kind, in_curtain_wall=True, by_words=False)
        if why := self.named_glass(name, "name"):
            return Taken(Role.TRANSPARENT, kind, why)
        if why := self.named_door(name):
            return Taken(self.door, kind, why)
        return Taken(Role.OCCLUDER, kind)

    def named_glass(self, text: str, what: str) -> str:
        """Why a name stands for glass or a window; empty if it does not."""
        words = GLASS | WINDOW if what == "name" else GLASS
        if not self.glass and NO_GLASS.intersection(map(_bare, words_of(text))):
            return ""
        return _found(self.glass, words, GLASS_COMPOUND, text, f"glass: {what}")

    def named_air(self, text: str | None) -> bool:
        """Whether a layer's material is the air or gas between panes."""
        return bool(AIR.intersection(map(_bare, words_of(text or ""))))

    def named_door(self, text: str) -> str:
        """Why a name stands for a door; empty if it does not."""
        return _found(self.doors_by, DOOR, DOOR_COMPOUND, text, "door: name")


def _found(pattern: str, words: frozenset[str], compound: re.Pattern, text: str, what: str) -> str:
    if pattern:
        found = re.search(pattern, text, re.IGNORECASE)
        return f"{what} {text!r} by {pattern!r}" if found else ""
    known = [word for word in words_of(text) if _bare(word) in words or compound.search(word)]
    return f"{what} {text!r} has {known[0]!r}" if known else ""


@cache
def words_of(text: str) -> tuple[str, ...]:
    """Words of a name in lower case: `FrontDoor 2`, `Glas_klar` and `TÜR01` are two, two and one."""
    parted = re.sub(r"(?<=[^\W\d_])(?=[A-ZÀ-ÖØ-Þ][^\WA-ZÀ-ÖØ-Þ\d_])|(?<=[a-zß-öø-ÿ])(?=[A-ZÀ-ÖØ-Þ])", " ", text)
    return tuple(re.findall(r"[^\W\d_]+", unicodedata.normalize("NFC", parted.lower())))


def _bare(word: str) -> str:
    """The word without accents."""
    parted = unicodedata.normalize("NFKD", word.translate(PLAIN))
    return "".join(letter for letter in parted if not unicodedata.combining(letter))


def named_class(name: str) -> str:
    """The IFC class that a name holds; empty if it holds none."""
    found = re.search(r"(?<![A-Za-z0-9])Ifc[A-Z][A-Za-z0-9]+", name)
    return found[0] if found and _ancestors(found[0]) else ""


@cache
def _ancestors(kind: str) -> frozenset[str]:
    """The class and all that it inherits from, in the first schema that knows it; empty where none does."""
    import ifcopenshell  # a third of a second, and only for names that hold an IFC class

    for schema in ("IFC4", "IFC2X3", "IFC4X3_ADD2"):
        try:
            declared = ifcopenshell.ifcopenshell_wrapper.schema_by_name(schema).declaration_by_name(kind).as_entity()
        except RuntimeError:
            continue
        names = []
        while declared:
            names.append(declared.name())
            declared = declared.supertype()
        return frozenset(names)
    return frozenset()
