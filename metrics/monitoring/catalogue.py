"""The catalogue of metrics. `docs/metrics.md` shows it as a table."""

from deconflict.foresight.forecast_errors.forecast_grades import GRADED_S, GRADES
from metrics.monitoring.catalogue_entry import CatalogueEntry, counter, gauge, histogram

_GRADES = ", ".join(f"{name} up to {most_m:g} m" for name, most_m in GRADES[:-1])


CATALOGUE: dict[str, CatalogueEntry] = {
    "deconflict_messages_total": counter(
        "Messages received, by result: accepted, rejected, or overtaken (a newer message arrived before it was read).",
        "vendor",
        "result",
    ),
    "deconflict_messages_per_second": gauge("Messages per second in the last minute, with any result.", "vendor"),
    "deconflict_deviations_total": counter("Deviations from the standard in accepted messages.", "vendor", "rule"),
    "deconflict_rejections_total": counter("Rejected messages, by the rule that rejects them.", "vendor", "rule"),
    "deconflict_broker_connected": gauge("Whether the broker of robots is being heard, 0 or 1.", "source"),
    "deconflict_broker_failures_total": counter("Failed or lost connections to a broker of robots.", "source"),
    "deconflict_dial_failures_total": counter("Failed or lost connections to a fleet manager.", "vendor"),
    "deconflict_robots_by_language": gauge("Robots, by the standard that they follow.", "vendor", "language"),
    "deconflict_robots": gauge(
        "Robots on the floors, by operational state; `silent` and `other` are none of the standard.",
        "vendor",
        "state",
    ),
    "deconflict_robots_unexamined": gauge(
        "Robots that are shown and not compared with others yet, by source: the ten with most, and the rest together.",
        "source",
    ),
    "deconflict_robots_not_compared": gauge(
        "Robots that are heard and compared with nobody until somebody mends something, by what is wrong.",
        "vendor",
        "fault",
    ),
    "deconflict_connections": gauge("Open connections of robots and fleet managers."),
    "deconflict_connections_refused_total": counter("Connections that were refused or closed, by reason.", "reason"),
    "deconflict_clock_offset_seconds": gauge(
        "Offset added to the vendor's timestamps to give the service's time. Negative if its clocks are fast.", "vendor"
    ),
    "deconflict_clock_delay_seconds": gauge(
        "Time from the measurement of a pose to its arrival, median of the vendor's robots.", "vendor"
    ),
    "deconflict_host_clock_off_seconds": gauge(
        "How far the host's clock is ahead of the service's clock, which does not jump when the host's clock is set."
    ),
    "deconflict_forecast_age_seconds": gauge(
        "Age of the poses on which forecasts are based, median of the vendor's robots.", "vendor"
    ),
    "deconflict_messages_shed_total": counter(
        "Messages over the vendor's rate limit that were not read because a newer message had arrived.", "vendor"
    ),
    "deconflict_datum_drift_metres": gauge(
        "How far from their first places the vendor's robots now stop at docks and chargers.",
        "vendor",
    ),
    "deconflict_changed_since_timestamp_seconds": gauge(
        "Unix time at which the vendor's forecasts, datum or clock began to differ from usual. Absent if nothing "
        "differs.",
        "vendor",
        "what",
    ),
    "deconflict_forecast_change_metres": gauge(
        "How much larger than usual the 80 % error of forecasts 3 s ahead is.", "vendor"
    ),
    "deconflict_datum_change_metres": gauge(
        "How far from the usual places the vendor's robots stop at docks and chargers.", "vendor"
    ),
    "deconflict_clock_change_seconds": gauge(
        "Difference between the clock offset of the vendor and its usual offset. Negative if it is smaller than usual.",
        "vendor",
    ),
    "deconflict_statuses_superseded_total": counter(
        "Status messages that a newer one replaced before the engine read them.", "vendor"
    ),
    "deconflict_robots_forgotten_total": counter("Robots forgotten because they were silent for too long.", "vendor"),
    "deconflict_robots_moved_total": counter("Robots heard elsewhere, by_hand or off_floor before.", "vendor", "how"),
    "deconflict_silences_total": counter(
        "Silences that ended, by outcome: there, elsewhere, or driven_through (its place, by another robot).",
        "vendor",
        "outcome",
    ),
    "deconflict_robots_probably_left": gauge(
        "Silent robots whose probability to be still there is below one half.", "vendor"
    ),
    "deconflict_recorded_bytes_total": counter("Bytes written to the recording."),
    "deconflict_recorded_lines_dropped_total": counter(
        "Lines that were lost because the recording could not write them."
    ),
    "deconflict_rejected_cut_total": counter(
        "Rejected messages beyond their sender's share of the recording: recorded as beginning and hash, or nothing.",
        "recorded",
    ),
    "deconflict_ticks_total": counter("Ticks of the engine. At each tick it receives the changes since the last one."),
    "deconflict_sweep_duration_seconds": histogram("Duration of one pass of the engine."),
    "deconflict_advice_asked_total": counter("Pieces of advice given to robots.", "vendor", "verb"),
    "deconflict_advice_ended_total": counter(
        "Pieces of advice that ended, by why: done, declined, lapsed, withdrawn, left or restarted.",
        "vendor",
        "verb",
        "why",
    ),
    "deconflict_advice_yielded_seconds_total": counter(
        "Time that robots of a vendor needed for what they were asked, by the vendor for whose robots it was.",
        "vendor",
        "other",
    ),
    "deconflict_advice_refused_total": counter("Refused advice, by why: unable or unwilling.", "vendor", "why"),
    "deconflict_advice_refused_seconds_total": counter(
        "Time that other robots stood because advice was refused, by the vendor that refused it.", "vendor", "why"
    ),
    "deconflict_advice_waiting": gauge("Groups of conflicts that wait for advice to be requested."),
    "deconflict_advice_late_total": counter("Requests for advice whose answer came after its deadline."),
    "deconflict_situation_failures_total": counter("Passes in which situations could not be made, and began anew."),
    "deconflict_advice_failures_total": counter("Requests for advice that ended in an error."),
    "deconflict_judge_failures_total": counter("Passes whose warnings could not be judged, and were judged anew."),
    "deconflict_advice_solve_seconds": histogram("Time to compute the advice for one request."),
    "deconflict_message_to_advisory_seconds": histogram(
        "Time from the arrival of a valid status to the publication of the advisories that reflect it.", "vendor"
    ),
    "deconflict_situations_open": gauge("Open situations: raised and not yet cleared.", "kind", "severity"),
    "deconflict_situations_total": counter(
        "Revisions of situations, by the kind that each was raised with and by event: raised, updated or cleared.",
        "kind",
        "event",
    ),
    "deconflict_advisories_open": gauge("Open advisories: raised and not yet cleared.", "kind", "severity"),
    "deconflict_advisories_total": counter(
        "Revisions of advisories, by event: raised, updated or cleared.", "kind", "event"
    ),
    "deconflict_conflicts_ended_total": counter(
        "Published conflicts that ended, once for each vendor in them, by why: met (came within the clearance), "
        "gave_way, not_met (no longer predicted), or left (a robot left, or another reason). Whether a warning was "
        "right says deconflict_warnings_judged_total.",
        "vendor",
        "outcome",
    ),
    "deconflict_warnings_judged_total": counter(
        "Warnings by what came of them, as in the report of a replay, about a minute later: came_true, in_vain, or "
        "not_judged. Warnings of partly examined robots are not_judged. Of a single machine, not of a cluster.",
        "outcome",
    ),
    "deconflict_vendor_warnings_judged_total": counter(
        "The same warnings, counted once for each vendor in them.", "vendor", "outcome"
    ),
    "deconflict_events_judged_total": counter(
        "Times at which two robots got in each other's way, by whether they were warned of (yes, no).",
        "warned_of",
    ),
    "deconflict_vendor_events_judged_total": counter(
        "The same events, counted once for each vendor in them.", "vendor", "warned_of"
    ),
    "deconflict_warned_ahead_seconds": histogram(
        "Of the events that were warned of, from raising the warning to the event: ahead by."
    ),
    "deconflict_revisions_deferred_total": counter(
        "Revisions of conflicts with the vendor's robots that waited for a later pass, as one pass makes only so many.",
        "vendor",
    ),
    "deconflict_pairs_left_out_total": counter(
        "Pairs of robots that a pass did not compare, because more came near each other than a floor can hold."
    ),
    "deconflict_robots_partly_examined": gauge(
        "Robots that are compared with some others only: in a crowd, or where more come near than have room.",
        "vendor",
    ),
    "deconflict_forecast_error_metres": gauge(
        "Forecast error at this horizon that is not exceeded in this share of cases. Old cases lose weight over days.",
        "vendor",
        "horizon_s",
        "share",
    ),
    "deconflict_forecast_band_coverage_ratio": gauge(
        "Share of forecast errors within the band that should contain the given share.", "vendor", "share"
    ),
    "deconflict_forecast_grade": gauge(
        f"1 for the vendor's grade. The grade depends on the 80 % error of forecasts {GRADED_S} s ahead: {_GRADES}, "
        f"{GRADES[-1][0]} above.",
        "vendor",
        "grade",
    ),
    "deconflict_robots_distrusted": gauge(
        "Robots that move otherwise than they announce by a path or an order: for 10 s on end, and until 30 s after.",
        "vendor",
    ),
    "deconflict_forecasts_distrusted_total": counter(
        "Forecasts with wider errors or not used, because the robot's motion contradicted its earlier forecasts.",
        "vendor",
    ),
    "deconflict_probability_outcomes_total": counter(
        "Watched pairs, sampled each second, by outcome: met (the robots got in each other's way), passed (they "
        "did not), or left (a robot became silent, or follows advice: the outcome is not known).",
        "outcome",
    ),
    "deconflict_conflicts": gauge("Pairs of robots in predicted conflict, confirmed or not."),
    "deconflict_invalid_forecasts_total": counter(
        "Forecasts that the engine could not use, by reason. The robot counts as standing where it was. Reason "
        "floor-not-listed: its batch does not list its floor; start all processes from one release.",
        "reason",
    ),
    "deconflict_sweep_segment_pairs_total": counter(
        "Pairs of path segments that passed the sweep's bounding box test."
    ),
    "deconflict_sweep_fcl_calls_total": counter("Pairs of shapes that the collision library decided."),
    "deconflict_resource_demand": gauge(
        "Robots that occupy a resource or zone or will need it within 15 minutes.", "resource"
    ),
    "deconflict_resource_expected_demand": gauge(
        "Robots that will need a charger within 15 minutes by their battery level but have not announced it.",
        "resource",
    ),
    "deconflict_resource_occupancy": gauge("Robots in a resource or zone now.", "resource"),
    "deconflict_resource_wait_seconds": gauge(
        "Longest expected wait at a resource or zone within 15 minutes.", "resource"
    ),
    "deconflict_zone_flow_per_second": gauge("Robots that leave a zone per second, averaged over minutes.", "zone"),
    "deconflict_ordinary_waits_total": counter(
        "Waits of robots for a blocker (blockage) or a place (contention) without an advisory, as they were short, or "
        "usual in one vendor's fleet at that place and hour.",
        "kind",
    ),
    "deconflict_ordinary_wait_seconds_total": counter("Duration of these waits.", "kind"),
    "deconflict_usual_places": gauge("Places at which it is learned how long waits usually are.", "waits"),
    "deconflict_usual_places_dropped_total": counter(
        "Places whose usual waits were forgotten, because there were too many places.", "waits"
    ),
    "deconflict_zone_saturation_ratio": gauge(
        "Mean number of robots in a zone, divided by the number at which its flow is greatest.", "zone"
    ),
    "deconflict_deadlocks_ahead": gauge("Rings of robots that wait for each other now or are predicted to."),
    "deconflict_arrival_time_ratio": gauge(
        "Time that robots take to a destination divided by the time that they announce, median.", "vendor"
    ),
    "deconflict_arrival_error_seconds": gauge(
        "Error of announced arrival times that is not exceeded in this share of cases. Old cases lose weight.",
        "vendor",
        "ahead_up_to_s",
        "share",
    ),
    "deconflict_arrivals_late_ratio": gauge(
        "Share of arrivals later than announced, by how far ahead they were announced.", "vendor", "ahead_up_to_s"
    ),
    "deconflict_advisories_stored_total": counter("Revisions of advisories stored and published."),
    "deconflict_delivery_delay_seconds": gauge(
        "Age of the oldest decision of the engine that is not stored. Rises while the store refuses them."
    ),
    "deconflict_canary_latency_seconds": gauge(
        "From the messages of two made-up robots to the stored advisory about them. Grows while none is stored."
    ),
    "deconflict_advisories_set_aside_total": counter(
        "Revisions of advisories that nobody receives, by reason: invalid (not a valid advisory), or unwritable "
        "(cannot be written though others can). The log names each.",
        "reason",
    ),
    "deconflict_advisories_pruned_total": CatalogueEntry(
        "counter",
        ("reason",),
        "Cleared advisories removed from the database, by reason: age (store.keep_days) or size "
        "(store.advisories_bytes).",
    ),
    "deconflict_store_bytes": CatalogueEntry("gauge", (), "Size of the advisory database without its free pages."),
    "deconflict_certificate_expires_timestamp_seconds": gauge(
        "Unix time at which the first certificate of a file ends, by its key in the site file.", "key"
    ),
    "deconflict_store_renewed": gauge(
        "1 if the database of advisories was damaged or gone, and begun anew, since the operator face has started."
    ),
    "deconflict_store_failures_total": counter("Attempts to store advisories that failed."),
    "deconflict_recording_failing": gauge("1 while nothing can be recorded; the log of the receiver says why."),
    "deconflict_recording_packing_failing": gauge(
        "1 while older segments of the recording can't be packed; the log of the receiver says why."
    ),
    "deconflict_port_failures_total": counter("Failed attempts of a role to open its port.", "section"),
    "deconflict_faults_total": counter("Errors of the program that ended nothing; the log has each.", "part"),
    "deconflict_owners_failures_total": counter(
        "Failed attempts to read or write the register of robots' owners.", "what"
    ),
    "deconflict_kept_messages_failures_total": counter(
        "Failed attempts to read or write the identity reports and statuses that are kept for a restart.", "what"
    ),
    "deconflict_owners_forgotten_total": counter(
        "Robots that the register of owners forgot because their vendor has too many.", "vendor"
    ),
    "deconflict_learned_parts_set_aside_total": counter(
        "Parts of what was learned that can't be used and are learned anew. `all` is the whole file.", "part"
    ),
    "deconflict_learning_failures_total": counter(
        "Failed attempts to read or write what was learned about vendors. Learning continues without it.", "what"
    ),
    "deconflict_store_unstored": gauge("Published revisions that are not yet stored on disk."),
    "deconflict_page_viewers": gauge("Open operator pages that follow the live view."),
    "deconflict_stream_subscribers": gauge("Open subscriptions to the advisory stream."),
    "deconflict_stream_dropped_total": counter(
        "Subscribers of the stream that were disconnected because they stopped reading."
    ),
    "deconflict_outlet_deliveries_total": counter("Revisions that a webhook or broker accepted.", "outlet"),
    "deconflict_outlet_failures_total": counter("Failed attempts to deliver a revision.", "outlet"),
    "deconflict_outlet_waiting": gauge("Revisions that wait because an outlet does not accept any.", "outlet"),
    "deconflict_lost_seconds_total": counter(
        "Seconds that robots of `vendor` lost because a robot of `by` was in their way, by how, and by the zone, "
        "resource or area where they began to lose time (empty outside all). Its error is in docs/losses.md.",
        "vendor",
        "by",
        "kind",
        "zone",
    ),
    "deconflict_losses_dropped_total": counter("Losses that the ledger lacks because it could not be written."),
    "deconflict_near_misses_total": counter(
        "Near misses: two robots came within the clearance by their forecasts, and at least one of them moved."
    ),
    "deconflict_blackboxes_total": counter(
        "Requested black boxes, by outcome: kept, unfounded (the reports show no near miss), failed (an error), or "
        "beyond (too many at once).",
        "outcome",
    ),
    "deconflict_role_up": gauge("1 if this role of the service answers, else 0.", "role"),
    "deconflict_members": gauge("Members of a cluster that are there; absent without a NATS server.", "part"),
    "deconflict_members_expected": gauge("Members of a cluster that must be there.", "part"),
    "deconflict_deadlines_missed_total": counter("Passes of the engine that took longer than engine.deadline_s."),
    "deconflict_engine_effort_reduced": gauge(
        "What the engine skips because it is overloaded: 0 nothing, 1 exact smallest separations, 2 also conflicts "
        "later than conflict.warning_s and most checks of queues.",
    ),
    "deconflict_site_reloads_total": counter(
        "Changed site files, by result: applied, or refused (the old settings stay in use).", "result"
    ),
    "deconflict_role_restarts_total": counter("Restarts of this role's process.", "role"),
    "deconflict_build_info": gauge("1 for the running release.", "version"),
}
"""Every metric by name. The values of labels are bounded sets: vendors, rules, states, roles, places; never robots."""

UNCATALOGUED = "deconflict_uncatalogued_measures"
UNCATALOGUED_HELP = "Series of a role that do not fit the catalogue: an error in the program."


def table() -> str:
    """The catalogue as the Markdown table of `docs/metrics.md`."""
    rows = ["| metric | kind | labels | meaning |", "| --- | --- | --- | --- |"]
    for name, entry in CATALOGUE.items():
        labels = ", ".join(f"`{label}`" for label in entry.labels)
        rows.append(f"| `{name}` | {entry.kind} | {labels} | {entry.help} |")
    rows.append(f"| `{UNCATALOGUED}` | gauge | `measure` | {UNCATALOGUED_HELP} |")
    return "\n".join(rows) + "\n"
