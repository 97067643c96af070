"""Plug-ins for the audit: localisation error, noisy sensors, fairer baselines."""

from dataclasses import replace, dataclass
import math, numpy as np
from scenarios.sensors import Sensor
from smartmot import MapArea
from smartmot.monitored_area import RectangularArea, Relevance, ego_extent, ego_frame, is_vulnerable
from smartmot.types import Boxes


# ---- localisation / map error: perception's map frame is off by (along, across, heading) ----
class _Shifted:
    def __init__(self, area, f):
        self.a, self.f = area, f

    def _b(self, b):
        c, y = self.f(b.center_m, b.yaw_rad)
        return Boxes(c, b.size_m, y)

    def kept(self, b, c):
        return self.a.kept(self._b(b), c)

    def relevance(self, b, c):
        return self.a.relevance(self._b(b), c)

    def on_lane(self, p):
        return self.a.on_lane(self.f(p, np.zeros(len(p)))[0])

    def polygons(self):
        return self.a.polygons()


class Shifted:
    name = "map"

    def __init__(self, scene, preset, across=0.0, along=0.0, head=0.0, sigma=0.0, seed=0):
        self.inner = MapArea(scene.network, scene.route, preset.map_area)
        self.route = scene.route
        self.p = (across, along, head)
        self.sigma = sigma
        self.seed = seed

    def at(self, ego):
        across, along, head = self.p
        if self.sigma:
            r = np.random.default_rng((self.seed, int(round(ego.stamp_s * 1000))))
            across += self.sigma * r.standard_normal()
            along += self.sigma * r.standard_normal()
        c, s = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)
        t = np.array([along * c - across * s, along * s + across * c])
        e = np.array([ego.x_m, ego.y_m])
        ch, sh = math.cos(head), math.sin(head)
        R = np.array([[ch, sh], [-sh, ch]])

        def f(p, y):
            return (np.asarray(p) - e) @ R + e + t, np.asarray(y) + head

        moved = replace(ego, x_m=ego.x_m + t[0], y_m=ego.y_m + t[1], yaw_rad=ego.yaw_rad + head)
        return _Shifted(self.inner.at(moved), f)


def _mk(**k):
    return lambda scene, preset: Shifted(scene, preset, **k)


left03, left05, left10 = _mk(across=0.3), _mk(across=0.5), _mk(across=1.0)
right03, right05, right10 = _mk(across=-0.3), _mk(across=-0.5), _mk(across=-1.0)
head1, head2 = _mk(head=math.radians(1)), _mk(head=math.radians(2))
headm1, headm2 = _mk(head=math.radians(-1)), _mk(head=math.radians(-2))
jit03 = _mk(sigma=0.3)
along5 = _mk(along=5.0)
zero = _mk()


# ---- sensors ----
def _sensor(**k):
    return lambda cfg, seed: _Det(replace(cfg, **k), seed)


class _Det(Sensor):
    pass


s02, s05 = _sensor(position_sigma_m=0.2), _sensor(position_sigma_m=0.5)
miss10, miss30 = _sensor(detection_probability=0.9), _sensor(detection_probability=0.7)


# ---- fairer baselines: rectangle whose "in the way" is the ego's path, as 'all' has; and a TTC/path AEB ----
class _Rect2:
    def __init__(self, inner, ego, half):
        self.i, self.ego, self.half = inner, ego, half

    def kept(self, b, c):
        return self.i.kept(b, c)

    def relevance(self, b, c):
        r = self.i.relevance(b, c)
        return Relevance(
            r.in_route & self._path(b), r.within_reach & self.on_lane(b.center_m), r.within_reach
        )

    def _path(self, b):
        _, _, lo, hi = ego_extent(b, self.ego)
        h = self.ego.width_m / 2 + 0.3
        return (lo <= h) & (hi >= -h)

    def on_lane(self, p):
        x, y = ego_frame(p, self.ego)
        return (x >= 0) & (np.abs(y) <= self.half) & (x <= 60)

    def polygons(self):
        return self.i.polygons()


class Rect2:
    name = "rectangular"

    def __init__(self, scene, preset, half=4.0, length=60.0, own=1.75):
        self.inner = RectangularArea(
            replace(preset.rectangular, half_width_m=half, max_length_m=length, braking_factor=1.4),
            preset.pipeline.braking_distance,
        )
        self.own = own

    def at(self, ego):
        return _Rect2(self.inner.at(ego), ego, self.own)


def rect_fair(scene, preset):
    return Rect2(scene, preset, 2.6, 30.0)


def rect_tuned(scene, preset):
    return Rect2(scene, preset, 4.0, 60.0)


def rect_tuned6(scene, preset):
    return Rect2(scene, preset, 6.0, 60.0)


class PathAEB:
    """Map-less: dynamic objects count only if the ego's CTRV path or straight path meets them within braking TTC; nothing else.
    Autoware-like: no area, static objects only on own swept path."""

    name = "all"

    def __init__(self, scene, preset):
        self.p = preset

    def at(self, ego):
        return _Path(ego)


class _Path:
    def __init__(self, ego):
        self.ego = ego

    def _y(self, p):
        x, y = ego_frame(p, self.ego)
        k = self.ego.yaw_rate_radps / max(self.ego.speed_mps, 0.5)
        return x, y - 0.5 * k * x * x

    def kept(self, b, c):
        return np.ones(len(b), bool)

    def relevance(self, b, c):
        ahead = ego_extent(b, self.ego)[1] >= 0
        x, y = self._y(b.center_m)
        half = 0.5 * np.minimum(b.size_m[:, 0], b.size_m[:, 1])
        on = ahead & (np.abs(y) <= self.ego.width_m / 2 + 0.3 + half)
        # a moving VRU counts within a corridor 4 m each side of the ego's curved path
        reach = ahead & (np.abs(y) <= 4.5)
        return Relevance(on, on, reach)

    def on_lane(self, p):
        x, y = self._y(p)
        return (x >= 0) & (np.abs(y) <= 1.75)

    def polygons(self):
        return []


def path_aeb(scene, preset):
    return PathAEB(scene, preset)


from smartmot.monitored_area import EverythingArea


def all_route(scene, preset):
    a = EverythingArea()
    a.route = scene.route
    return a


def rect_route(scene, preset):
    a = RectangularArea(preset.rectangular, preset.pipeline.braking_distance)
    a.route = scene.route
    return a


class _AllPath(_Path):
    """Everything seen may be a threat if moving; the ego's way is its planned path (no lanes, no kerbs, no margin)."""

    def __init__(self, ego, route):
        self.ego, self.route = ego, route

    def relevance(self, b, c):
        from smartmot.monitored_area import outline_points

        ahead = ego_extent(b, self.ego)[1] >= 0
        st, off = self.route.place(outline_points(b))
        here, mine = self.route.project(self.ego.x_m, self.ego.y_m)
        near = (np.abs(off - mine) <= self.ego.width_m / 2 + 0.3) & (st >= here)
        on = near.reshape(len(b), -1).any(axis=1) & ahead
        return Relevance(on, on, ahead)

    def on_lane(self, p):
        st, off = self.route.place(np.asarray(p))
        here, mine = self.route.project(self.ego.x_m, self.ego.y_m)
        return (np.abs(off - mine) <= 1.75) & (st >= here)


class AllPath:
    name = "all"

    def __init__(self, scene, preset):
        self.route = scene.route

    def at(self, ego):
        return _AllPath(ego, self.route)


def all_path(scene, preset):
    return AllPath(scene, preset)
