#!/usr/bin/env python3
"""Checks a demo's report.json against the bars that must hold everywhere. Usage: check_report.py FILE"""

import json
import sys


def main() -> int:
    with open(sys.argv[1], encoding="utf-8") as file:
        report = json.load(file)
    avatar, bare, body = report["avatar"], report["bare_body"], report["body"]
    bars = [
        ("first track within 2 s", report["time_to_first_track_secs"], "<=", 2.0),
        ("tracked fraction", report["tracked_fraction"], ">=", 1.0),
        ("keyframes", report["keyframes"], ">=", 8),
        ("body V2V, mm", body["v2v_mm"], "<=", 60.0),
        ("avatar observed / bare observed", avatar["observed_mm"] / bare["observed_mm"], "<=", 0.6),
        ("avatar D_f / bare D_f", avatar["d_f_cm"] / bare["d_f_cm"], "<=", 0.7),
        ("seconds in all", report["seconds_total"], "<=", 240.0),
        ("peak memory, MB", report["peak_memory_mb"], "<=", 2048.0),
    ]
    failed = 0
    for name, value, relation, bar in bars:
        holds = value <= bar if relation == "<=" else value >= bar
        failed += not holds
        print(f"{'ok  ' if holds else 'FAIL'} {name}: {value:.3f} ({relation} {bar})")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
