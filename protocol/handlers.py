"""Name the parts of the firmware behind the object dictionary: what reading an entry gives and writing it does.

A name is "Class.name"; `ObjectDictionary.bind` finds it when the part is made. A method whose name ends with "_at" is
given the entry's address. An entry in neither table is a stored value, which has no effect until it is read.
"""

from collections.abc import Iterable
from typing import Final

from steptwin.protocol import od
from steptwin.protocol.objects import ENTRIES, PDO_ENTRIES_MAX, RESTORES, STEP_ENTRIES, STORES

_PDO_CHECKS: Final = {
    od.PDO_COB_ID: "ProcessData.check_cob_id_at",
    od.PDO_TRANSMISSION_TYPE: "ProcessData.check_transmission_type",
    od.PDO_INHIBIT_TIME: "ProcessData.check_while_invalid_at",
    od.PDO_EVENT_TIMER: "ProcessData.check_configurable",
    od.PDO_SYNC_START: "ProcessData.check_while_invalid_at",
}
_MAPPING_CHECKS: Final = {
    0: "ProcessData.check_count_at",
    **dict.fromkeys(range(1, PDO_ENTRIES_MAX + 1), "ProcessData.check_mapped_at"),
}
"""By the sub-index of a PDO's parameter."""


def _of_pdos(indices: Iterable[int], checks: dict[int, str]) -> dict[int, str]:
    """Return the names by address; a receive PDO has not all parameters of a transmit PDO."""
    names = {od.address_of(index, subindex): name for index in indices for subindex, name in checks.items()}
    return {address: name for address, name in names.items() if address in ENTRIES}


READ_FROM: Final = {
    od.ERROR_REGISTER: "AxisErrors.register",
    od.ERROR_HISTORY_COUNT: "AxisErrors.history_length",
    **dict.fromkeys(od.ERROR_HISTORY, "AxisErrors.history_at"),
    **dict.fromkeys((*STORES, *RESTORES), "ParameterStorage.ability"),
    od.TIME_STAMP: "AxisNode.time_stamp_us",
    od.BOARD_TEMPERATURE: "BoardReadings.temperature_decidegc",
    od.SUPPLY_VOLTAGE: "BoardReadings.supply_10mv",
    od.PVT_NEXT_SEQUENCE: "Interpolation.next_sequence",
    od.PVT_FREE_RECORDS: "Interpolation.free_records",
    od.PVT_FLAGS: "Interpolation.flags",
    od.PVT_EXECUTING_SEQUENCE: "Interpolation.executing_sequence",
    od.BOARD_CLOCK_US: "AxisNode.board_clock_us",
    od.DELAYED_STEPS: "BoardMotion.delayed_steps",
    od.EMCYS_LOST: "AxisErrors.lost",
    od.EMERGENCY_STOP: "AxisDrive.emergency_stopped",
    od.ROBOT_NAME_CRC: "AxisNode.robot_name_crc",
    od.CHARGE_TOKEN: "Charge.token",
    od.FAULT_NUMBER: "AxisDrive.fault_number",
    od.FAULT_AGE_MS: "AxisDrive.fault_age_ms",
    od.ROTOR_POSITION_STEPS: "EmulatedAxis.count_at",
    od.LOST_STEPS: "EmulatedAxis.count_at",
    od.DRIVER_VIOLATIONS: "EmulatedAxis.count_at",
    od.DRIVER_MICROSTEPS: "EmulatedAxis.count_at",
    od.SHAFT_POSITION: "EmulatedAxis.rotor_at",
    od.SLIPPED_FULL_STEPS: "EmulatedAxis.rotor_at",
    od.STATUSWORD: "AxisNode.statusword",
    od.MODE_OF_OPERATION_DISPLAY: "AxisDrive.mode_number",
    od.POSITION_DEMAND: "BoardMotion.demand_units",
    od.POSITION_ACTUAL: "BoardMotion.counter_units",
    od.VELOCITY_ACTUAL: "BoardMotion.velocity_units_per_s",
    od.BUFFER_POSITION: "BoardMotion.queued",
    od.FOLLOWING_ERROR_ACTUAL: "PositionReference.following_error_units",
    od.POSITION_DEMAND_STEPS: "BoardMotion.demand_steps",
    od.DIGITAL_INPUTS: "Supervision.inputs",
}
"""The attribute, property or method that supplies the present value of an entry."""

OBEYED_BY: Final = {
    od.ERROR_HISTORY_COUNT: "AxisErrors.clear_history",
    **dict.fromkeys(STORES, "ParameterStorage.save_at"),
    **dict.fromkeys(RESTORES, "ParameterStorage.load_at"),
    od.TIME_STAMP: "AxisNode.set_clock",
    od.EMCY_COB_ID: "AxisErrors.check_new_cob_id",
    **dict.fromkeys(od.CONSUMER_HEARTBEATS, "HeartbeatConsumer.watch_at"),
    od.PRODUCER_HEARTBEAT_TIME: "AxisNode.set_heartbeat_period",
    od.SYNC_COUNTER_OVERFLOW: "ProcessData.check_sync_overflow",
    **_of_pdos((*od.RPDO_COMMUNICATION, *od.TPDO_COMMUNICATION), _PDO_CHECKS),
    **_of_pdos((*od.RPDO_MAPPING, *od.TPDO_MAPPING), _MAPPING_CHECKS),
    **dict.fromkeys(STEP_ENTRIES, "DriverSettings.change_at"),
    od.EMERGENCY_STOP: "AxisDrive.stop_at_once",
    od.CHARGE_TOKEN: "Charge.claim",
    od.CHARGE_RELEASE: "Charge.release",
    od.FAULT_RESET: "AxisDrive.reset_numbered_fault",
    od.CONTROLWORD: "AxisDrive.obey_controlword",
    od.MODE_OF_OPERATION: "AxisDrive.select_mode",
    od.TARGET_POSITION: "CyclicPosition.note_set_point",
    od.POSITION_LIMIT_MIN: "SoftLimits.check_low",
    od.POSITION_LIMIT_MAX: "SoftLimits.check_high",
    od.PVT_SEQUENCE: "Interpolation.take_record",
    od.INTERPOLATION_PERIOD: "CyclicPosition.check_period",
    od.BUFFER_CLEAR: "Interpolation.clear",
    od.DIGITAL_OUTPUTS: "AxisNode.switch_outputs_at",
    od.DIGITAL_OUTPUTS_MASK: "AxisNode.switch_outputs_at",
    od.TARGET_VELOCITY: "ProfileVelocity.follow_target",
}
"""The method that obeys a value written, or refuses it, after the checks of its row and before it is stored."""
