"""Roads with one feature each, against values of other programs and closed forms."""

import json
from pathlib import Path

import numpy as np
import pytest

from opendrive import LaneKey, load_map

FILE = Path(__file__).parents[2] / "data" / "opendrive" / "probes.json"
PROBES = json.loads(FILE.read_text(encoding="utf-8"))["probes"]


def element(tag, attributes, *children):
    written = "".join(f' {name}="{value}"' for name, value in attributes.items())
    return f"<{tag}{written}>{''.join(element(*child) for child in children)}</{tag}>"


def document(probe):
    """The OpenDRIVE text of a probe."""

    def records(name):
        return "".join(element(*record) for record in probe[name])

    def side(sign):
        lanes = [values for values in probe["lanes"] if int(values[0]) * sign > 0]
        return "".join(element("lane", {"id": i, "type": kind}, *widths) for i, kind, widths in lanes)

    offset = element("offset", probe["header_offset"]) if "header_offset" in probe else ""
    return (
        f'<OpenDRIVE><header revMajor="1" revMinor="6" name="" version="1">{offset}</header>'
        f'<road name="r" length="{probe["length"]}" id="1" junction="-1" rule="{probe["rule"]}">'
        f"<planView>{records('plan')}</planView><elevationProfile>{records('elevation')}</elevationProfile>"
        f"<lateralProfile>{records('lateral')}</lateralProfile><lanes>{records('lane_offsets')}"
        f'<laneSection s="0"><left>{side(1)}</left><center><lane id="0" type="none"/></center>'
        f"<right>{side(-1)}</right></laneSection></lanes></road></OpenDRIVE>"
    )


@pytest.mark.parametrize("name", PROBES)
def test_probes(tmp_path, name):
    probe = PROBES[name]
    file = tmp_path / f"{name}.xodr"
    file.write_text(document(probe), encoding="utf-8")
    network = load_map(file)
    for (lane_id, s), row in zip(probe["queries"], probe["expected"], strict=True):
        lane = network.lane_index_of(LaneKey("1", 0, lane_id))
        x, y, z, heading = (float(value) for value in network.center_line(lane, s))
        along = heading if network.lanes.direction[lane] > 0 else heading + np.pi
        assert (x, y, z) == pytest.approx(row[:3], abs=2e-6), (lane_id, s)
        assert np.sin(along - row[3]) == pytest.approx(0.0, abs=2e-6), (lane_id, s)
        assert np.cos(along - row[3]) > 0.0, (lane_id, s)
        assert float(network.lane_width(lane, s)) == pytest.approx(row[4], abs=1e-6), (lane_id, s)
