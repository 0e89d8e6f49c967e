"""What a person looks for at a robot, and does there. Each completes "somebody should go to it and ..."."""

FIND_CAUSE = "see whether it is blocked or stopped by a fault, and clear the way or restart it"
DRIVE_ASIDE = "drive it aside by hand, so that the others can pass"
DRIVE_ON = "drive it on by hand"
