"""Signals and their controllers (chapter "Signals")."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LaneRange:
    """Lanes, by id, that a signal or object applies to (chapter "Signals"); both ends included."""

    from_lane: int
    to_lane: int


@dataclass(frozen=True, slots=True)
class SignalDependency:
    """Signal that is controlled by the one it is listed in (chapter "Signals")."""

    signal_id: str
    type: str


@dataclass(frozen=True, slots=True)
class SignalLink:
    """Object or signal that a signal belongs with (chapter "Signals")."""

    element_type: str
    element_id: str
    type: str


@dataclass(frozen=True, slots=True)
class SignalPosition:
    """Where a signal physically stands, if not where it applies (chapter "Signals").

    Attributes:
        road_id: road whose s, t and height above it are meant; empty for x, y, z of the map frame.
        position_m: s, t, height or x, y, z.
        heading_rad: heading, relative to the road's if there is one.
        pitch_rad: pitch.
        roll_rad: roll.
    """

    road_id: str
    position_m: tuple[float, float, float]
    heading_rad: float
    pitch_rad: float
    roll_rad: float


@dataclass(frozen=True, slots=True)
class Signal:
    """Traffic sign or light (chapter "Signals").

    Attributes:
        id: unique id.
        name: free name.
        s_m: position along the road.
        t_m: lateral position.
        z_offset_m: height above the road.
        heading_offset_rad: heading relative to the road's (to its opposite, for orientation ``-``).
        type: code from the country's catalogue.
        subtype: code from the country's catalogue.
        country: country code; empty when absent.
        value: value of the sign, such as its speed; None when absent.
        unit: unit of `value`; empty when absent.
        text: additional text.
        dynamic: whether its state changes (a traffic light).
        orientation: ``+`` valid along s, ``-`` valid against s, ``none`` both.
        height_m: height of the sign; None when absent.
        width_m: width of the sign; None when absent.
        validity: lanes it applies to; empty means all.
        pitch_rad: pitch.
        roll_rad: roll.
        length_m: depth of the sign; None when absent.
        country_revision: year of the catalogue; empty when absent.
        dependencies: signals it controls.
        links: objects and signals it belongs with.
        position: where it physically stands, if elsewhere.
        extra: other elements, such as user data and semantics.
        attributes: further attributes, with their values.
    """

    id: str
    name: str
    s_m: float
    t_m: float
    z_offset_m: float
    heading_offset_rad: float
    type: str
    subtype: str
    country: str
    value: float | None
    unit: str
    text: str
    dynamic: bool
    orientation: str
    height_m: float | None
    width_m: float | None
    validity: tuple[LaneRange, ...]
    pitch_rad: float = 0.0
    roll_rad: float = 0.0
    length_m: float | None = None
    country_revision: str = ""
    dependencies: tuple[SignalDependency, ...] = ()
    links: tuple[SignalLink, ...] = ()
    position: SignalPosition | None = None
    extra: tuple[str, ...] = ()
    attributes: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class SignalReference:
    """Reuse on this road of a signal placed on another one (chapter "Signals")."""

    signal_id: str
    s_m: float
    t_m: float
    orientation: str
    validity: tuple[LaneRange, ...]
    extra: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Control:
    """Signal of a controller (chapter "Signals")."""

    signal_id: str
    type: str


@dataclass(frozen=True, slots=True)
class Controller:
    """Signals that act together (chapter "Signals"); `sequence` is None when absent."""

    id: str
    name: str
    sequence: int | None
    controls: tuple[Control, ...]
    extra: tuple[str, ...] = ()
