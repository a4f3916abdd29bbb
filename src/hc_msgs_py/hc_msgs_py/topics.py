"""Names of the topics and of the nodes: what docs/design.md fixes, in one place."""

from __future__ import annotations

from typing import Final

SAMPLE: Final = "indenter/sample"
SAMPLES: Final = "indenter/samples"
WRENCH: Final = "indenter/wrench"
JOINT_STATES: Final = "indenter/joint_states"
TIP: Final = "indenter/tip"
TRUTH: Final = "indenter/truth"
ESTIMATE: Final = "hc/estimate"
ESTIMATES: Final = "hc/estimates"
TACTILE_SAMPLE: Final = "tactile/sample"
TACTILE_ESTIMATE: Final = "tactile/estimate"
RECONSTRUCTED_WRENCH: Final = "hc/reconstructed_wrench"
CONFIGURATION: Final = "hc/configuration"
EVENTS: Final = "hc/events"
CONTACTS: Final = "hc/contacts"
MASTER_MEASURED_CP: Final = "master/measured_cp"
MASTER_SERVO_CF: Final = "master/servo_cf"
MASTER_MODEL: Final = "master/model"
SLAVE_SETPOINT_CP: Final = "slave/setpoint_cp"
DIAGNOSTICS: Final = "/diagnostics"

NODE_INDENTER: Final = "indenter"
NODE_ESTIMATOR: Final = "estimator"
NODE_ARRAY_ESTIMATOR: Final = "array_estimator"
NODE_RECORDER: Final = "recorder"
NODE_PLAYER: Final = "player"
NODE_MASTER: Final = "master"
NODE_SLAVE: Final = "slave"
NODE_DASHBOARD: Final = "dashboard"

FRAME_INDENTER_TIP: Final = "indenter_tip"
