import sys, time, json, math, os

sys.path.insert(0, ".")
from dataclasses import replace
import numpy as np
from concurrent.futures import ProcessPoolExecutor
from scenarios.presets import PHYSICAL
from scenarios.scenes.scenes import choose_scenes
from scenarios.openscenario.reader import load
from scenarios.library import scenario_path
from scenarios.simulation import Simulation, StopRule
from scenarios.strategies import make_strategy
from evaluation.runs import perception_map, load_named_map
import aeb_plug as A

THROUGH = StopRule(time_limit_s=60.0, after_resume_s=math.inf, after_pass_m=math.inf)
SC = choose_scenes()


def pre(route=False, match=None, late=False, **s):
    p = replace(PHYSICAL, sensor=replace(PHYSICAL.sensor, **s))
    if late:
        from smartmot.braking import BrakingDistance

        p = replace(
            p,
            pipeline=replace(
                p.pipeline,
                braking_distance=BrakingDistance(1 / (2 * 8.8 * 3.6**2), 0.45 / 3.6, 3.4),
                aeb=replace(p.pipeline.aeb, near_m=3.4),
            ),
        )
    if match:
        tr = p.pipeline.tracker
        p = replace(
            p,
            pipeline=replace(
                p.pipeline, tracker=replace(tr, filter=replace(tr.filter, position_sigma_m=match))
            ),
        )
    if route:
        p = replace(p, pipeline=replace(p.pipeline, forecast=replace(p.pipeline.forecast, ego="route")))
    return p


def area(base, **k):
    if base == "map":
        return (lambda s, p: A.Shifted(s, p, **k)) if k else (lambda s, p: make_strategy("map", p, s))
    return base if callable(base) else (lambda s, p: make_strategy(base, p, s))


def margin(f, m):
    return lambda s, p: f(s, replace(p, map_area=replace(p.map_area, vru_margin_m=m)))


def one(job):
    label, k, seed = job
    sk, mk, route = CFG[label]
    sc = SC[k]
    d = load(scenario_path(sc.file), dict(sc.parameters))
    p = pre(route, **sk, phase_s=round(0.01 * (seed % 5), 3))
    name = perception_map(d, None)
    try:
        o = Simulation(
            d,
            p,
            lambda s: mk(s, p),
            seed,
            load_named_map(name) if name else None,
            rule=THROUGH if sc.must == "nothing" else StopRule(),
        ).run()
    except Exception as e:
        return dict(
            label=label, scene=sc.scene, variant=sc.variant, must=sc.must, seed=seed, err=repr(e)[:200]
        )
    t = o.log.table()
    own = np.flatnonzero(t["kind"] == "ego")
    sp = t["speed_mps"][own]
    return dict(
        label=label,
        scene=sc.scene,
        variant=sc.variant,
        must=sc.must,
        seed=seed,
        hit=o.contact is not None,
        v=round(o.impact_speed_mps * 3.6, 2),
        flag=o.flag_time_s,
        early=bool(o.false_stop),
        need=bool(sc.must == "nothing" and (o.flag_time_s is not None or sp.min() < 0.1)),
        km=float(np.hypot(np.diff(t["x_m"][own]), np.diff(t["y_m"][own])).sum()) / 1000,
    )


CFG = {}
M = area("map")


def add(label, sensor=None, mk=M, route=False):
    CFG[label] = (sensor or {}, mk, route)


def _z(n):
    return area(n)


for n, f, r in (
    ("rect", area("rectangular"), 0),
    ("map", M, 0),
    ("map+route", M, 1),
    ("all", area("all"), 0),
):
    add(n, mk=f, route=bool(r))
    add(n + " | s0.2", dict(position_sigma_m=0.2), f, bool(r))
    add(n + " | s0.5", dict(position_sigma_m=0.5), f, bool(r))
    add(n + " | 10Hz", dict(rate_hz=10.0), f, bool(r))
    add(n + " | lat100", dict(latency_s=0.1), f, bool(r))
    add(n + " | lat200", dict(latency_s=0.2), f, bool(r))
    add(n + " | miss10", dict(detection_probability=0.9), f, bool(r))
    add(n + " | miss30", dict(detection_probability=0.7), f, bool(r))
    add(
        n + " | real",
        dict(
            position_sigma_m=0.2,
            yaw_sigma_rad=math.radians(5),
            rate_hz=10.0,
            latency_s=0.1,
            detection_probability=0.9,
        ),
        f,
        bool(r),
    )
for a in (0.3, 0.5, 1.0):
    for s in (1, -1):
        add(f"map+route | loc {s * a:+.1f} m across", mk=area("map", across=s * a), route=True)
for h in (1, 2):
    for s in (1, -1):
        add(f"map+route | head {s * h:+d} deg", mk=area("map", head=math.radians(s * h)), route=True)
add("map+route | jitter 0.3", mk=area("map", sigma=0.3), route=True)
add("map+route | along +5", mk=area("map", along=5.0), route=True)
add("map+route | along -5", mk=area("map", along=-5.0), route=True)
for m in (4.0,):
    add("map4+route", mk=margin(M, m), route=True)
    for a in (0.5, 1.0):
        for s in (1, -1):
            add(f"map4+route | loc {s * a:+.1f}", mk=margin(area("map", across=s * a), m), route=True)
add("all+route", mk=A.all_route, route=True)
add("rect+route", mk=A.rect_route, route=True)
add("planned path, no lanes", mk=A.all_path, route=True)
add(
    "planned path, no lanes | real",
    dict(
        position_sigma_m=0.2,
        yaw_sigma_rad=math.radians(5),
        rate_hz=10.0,
        latency_s=0.1,
        detection_probability=0.9,
    ),
    A.all_path,
    True,
)
add("rect_fair", mk=A.rect_fair)
add("rect_tuned4x60", mk=A.rect_tuned)
add("rect_tuned6x60", mk=A.rect_tuned6)
add("path_aeb(no map)", mk=A.path_aeb)
REAL = dict(
    position_sigma_m=0.2,
    yaw_sigma_rad=math.radians(5),
    rate_hz=10.0,
    latency_s=0.1,
    detection_probability=0.9,
)
for n, f, r in (
    ("rect_fair", A.rect_fair, False),
    ("map+route", M, True),
    ("all", area("all"), False),
    ("planned path, no lanes", A.all_path, True),
):
    add(n + " | s0.2 matched", dict(position_sigma_m=0.2, match=0.2), f, r)
    add(n + " | s0.5 matched", dict(position_sigma_m=0.5, match=0.5), f, r)
    add(n + " | real matched", dict(REAL, match=0.2), f, r)
add("all+route late", dict(late=True), A.all_route, True)
add("map+route late", dict(late=True), M, True)
if __name__ == "__main__":
    labels = sys.argv[2].split(";")
    assert all(l in CFG for l in labels), [l for l in labels if l not in CFG]
    seeds = [int(x) for x in sys.argv[3].split(",")]
    out = open(sys.argv[1], "a")
    t = time.time()
    jobs = [(l, k, s) for l in labels for s in seeds for k in range(len(SC))]
    with ProcessPoolExecutor(int(sys.argv[4])) as ex:
        for r in ex.map(one, jobs, chunksize=5):
            out.write(json.dumps(r) + "\n")
            out.flush()
    print(len(jobs), round(time.time() - t, 1), "s")
