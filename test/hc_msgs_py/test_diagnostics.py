"""The bytes of a status are a message that rclpy reads as the status."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from hc_msgs_py.diagnostics import Level, encode

TEXT = st.text(st.characters(blacklist_characters="\0", blacklist_categories=["Cs"]), max_size=20)


def test_the_name_of_a_file_may_hold_any_bytes():
    data = encode(0, 1, ("player", "\udcff.mcap", "/a/\udcfe"), {"bag": "\udc80"})
    (status,) = deserialize_message(data, DiagnosticArray).status
    assert (status.message, status.hardware_id) == ("\\udcff.mcap", "/a/\\udcfe")
    assert status.values[0].value == "\\udc80"


@given(
    st.integers(0, (2**31 - 1) * 10**9),
    st.sampled_from(Level),
    st.tuples(TEXT, TEXT, TEXT),
    st.dictionaries(TEXT, st.one_of(TEXT, st.integers(), st.floats(), st.booleans()), max_size=9),
)
@settings(max_examples=100)
def test_a_status_is_read_as_its_message(stamp_ns, level, texts, values):
    name, message, hardware_id = texts
    array = DiagnosticArray()
    array.header.stamp.sec, array.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    array.status = [
        DiagnosticStatus(
            level=bytes([level]),
            name=name,
            message=message,
            hardware_id=hardware_id,
            values=[
                KeyValue(key=key, value=f"{value:.6g}" if isinstance(value, float) else str(value))
                for key, value in values.items()
            ],
        )
    ]
    data = encode(stamp_ns, level, texts, values)
    # What rclpy leaves between two texts, and behind the last one, is any bytes.
    assert deserialize_message(data, DiagnosticArray) == array
    assert 0 <= len(serialize_message(array)) - len(data) < 4
