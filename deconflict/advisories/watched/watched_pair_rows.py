"""The records of watched pairs that kernels read, and the settings that decide."""

import numpy as np

OPEN_ADVISORY = np.dtype(
    [
        ("is_open", np.bool_),  # the pair has an open advisory; otherwise the other fields mean nothing
        ("has_begun", np.bool_),  # the conflict had begun when the newest revision was made
        ("severity", np.int64),  # index in `severity.SEVERITIES`
        ("encounter_class", np.int64),  # index in `encounter.CLASSES`
        ("floor", np.int64),  # index of the floor; -1 if it is not known
        ("updated_s", np.float64),  # time of the newest revision
        ("probability", np.float64),  # as the newest revision gives it, as all below
        ("contact_s", np.float64),  # predicted time of the conflict
        ("separation_m", np.float64),  # predicted smallest separation
        ("x_m", np.float64),  # predicted place
        ("y_m", np.float64),
    ],
    align=True,
)
"""The newest revision of the open advisory of a watched pair."""

WATCHED_PAIR = np.dtype(
    [
        ("in_use", np.bool_),  # a pair has this row
        ("inside", np.bool_),  # within the clearance, or not yet drawn apart from it
        ("met", np.bool_),  # it came within the clearance while the advisory was open
        ("predicted", np.bool_),  # this pass has a prediction of the pair
        ("updated", np.bool_),  # since the last pass a robot of it has a new forecast, or has left
        ("looks", np.int64),  # one bit for each of the last looks, 1 if it was alerting; the newest is the lowest bit
        ("predicted_s", np.float64),  # when a pair with an advisory was last predicted as likely enough
        ("weighed_contact_s", np.float64),  # predicted time of the last weighed prediction
        ("weighed_separation_m", np.float64),  # its smallest separation
        ("weighed_until_s", np.float64),  # from then on, that prediction may be worth a revision; inf if never
        ("still_since_s", np.float64),  # since when both stand or one gives way to the other; inf if neither
        ("lower_since_s", np.float64),  # since when its advisory should be less severe; inf if it should not
    ],
    align=True,
)
"""What is remembered of a watched pair. A prediction is weighed if it was compared and was not worth a revision."""

PREDICTED = np.dtype(
    [
        ("contact_s", np.float64),
        ("separation_m", np.float64),
        ("start_separation_m", np.float64),
        ("fresh", np.bool_),
        ("probability", np.float64),
        ("deciding", np.float64),
        ("still", np.bool_),
        ("both_present", np.float64),
    ],
    align=True,
)
"""What decides of a `conflict_predictions.Prediction`, which has the meaning of each field."""

THRESHOLDS = np.dtype(
    [
        ("clearance_m", np.float64),  # a conflict is a separation of no more than this
        ("apart_m", np.float64),  # a pair that begins farther apart than this has drawn apart
        ("raise_probability", np.float64),  # a less likely conflict raises no advisory
        ("held_probability", np.float64),  # a less likely conflict lets no advisory stand
        ("evident", np.float64),  # a more likely one raises an advisory at its first look
        ("urgent_s", np.float64),  # a conflict nearer than this raises an advisory at its first look
        ("clear_after_s", np.float64),  # an advisory clears after its conflict was unlikely, or still, for so long
        ("warning_s", np.float64),  # a conflict nearer than this is a warning
        ("critical_s", np.float64),  # a conflict nearer than this is critical
        ("looks_mask", np.int64),  # one bit for each look that is remembered
        ("looks_needed", np.int64),  # this many alerting looks raise an advisory
    ],
    align=True,
)
"""What decides, from the site's settings."""
