"""What reading one message costs: `python -m benchmarks.messages`.

Best of many short runs, so that a busy machine shows as little as it can. The ratio is to pydantic's validation
alone of the same bytes in the same run.
"""

import json
from timeit import repeat
from typing import Any

from ingest.messages import document, read
from ingest.reports import StatusReport

T = "2023-11-14T22:13:{:02d}.250Z"
DATUM = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b01"
ANGLE = {"x": 0.0, "y": 0.0, "z": 0.49999, "w": 0.86603}
RUNS, CALLS = 60, 200


def conforming() -> dict[str, Any]:
    """A status with ten path points, nothing of it against the standard."""
    path = [{"timestamp": T.format(20 + i), "x": 12.345 + i, "y": 6.789, "angle": dict(ANGLE)} for i in range(10)]
    return {
        "uuid": "6b2f3f0a-54a2-4d6e-9b0e-6c1f0a7d9e11",
        "timestamp": T.format(20),
        "operationalState": "navigating",
        "location": {"x": 12.345, "y": 6.789, "angle": ANGLE, "planarDatum": DATUM},
        "velocity": {"linear": 1.25, "angular": ANGLE},
        "batteryPercentage": 81.5,
        "remainingRunTime": 4.5,
        "loadPercentageStillAvailable": 60.0,
        "path": path,
    }


def official() -> dict[str, Any]:
    """The same as the official sample sender would spell it: upper case, no colon, the other datum key."""
    report = conforming()
    report["uuid"] = report["uuid"].upper()
    report["location"]["planarDatum"] = DATUM.upper()
    report["timestamp"] = _no_colon(report["timestamp"])
    for point in report["path"]:
        point["timestamp"] = _no_colon(point["timestamp"])
        point["planarDatum"] = DATUM.upper()
    return report


def _no_colon(timestamp: str) -> str:
    return timestamp[:19] + "+0000"


def us(call: Any) -> float:
    return min(repeat(call, number=CALLS, repeat=RUNS)) / CALLS * 1e6


def main() -> None:
    wrong_type = {"batteryPercentage": "81.5"}
    cases = {
        "conforming": conforming(),
        "a number as text": conforming() | wrong_type,
        "official dialect": official(),
        "both": official() | wrong_type,
    }
    plain = json.dumps(conforming()).encode()
    alone_us = us(lambda: StatusReport.model_validate_json(plain))
    print(f"{'status, ten points':<24}{'bytes':>8}{'read us':>10}{'ratio':>8}{'document us':>14}")
    for name, report in cases.items():
        raw = json.dumps(report).encode()
        read_us, document_us = us(lambda raw=raw: read(raw)), us(lambda raw=raw: document(raw))
        print(f"{name:<24}{len(raw):>8}{read_us:>10.1f}{read_us / alone_us:>8.1f}{document_us:>14.1f}")


if __name__ == "__main__":
    main()
