"""Which publisher a message is of, from the numbers that each publisher gives its own."""

from hypothesis import given
from hypothesis import strategies as st

from hc_estimator.stream.publishers import MOST_LINES, PublisherLines

MS = 1_000_000


class Topic:
    """Publishers with counts of their own, and what the lines make of their messages."""

    def __init__(self, publishers):
        self.publishers = publishers
        self.lines = PublisherLines(lambda: self.publishers)
        self.numbers = {}

    def send(self, name, time_ms, *, lost=0):
        self.numbers[name] = self.numbers.get(name, 0) + 1 + lost
        return self.lines.follows(self.numbers[name], time_ms * MS)


def test_one_publisher_is_followed_through_losses_and_a_restart():
    topic = Topic(1)
    assert all(topic.send("a", t) for t in range(100))
    assert topic.send("a", 100, lost=7)
    assert topic.lines.lost == 7
    topic.numbers["a"] = 0
    assert all(topic.send("a", t) for t in range(101, 200))
    assert (topic.lines.lost, topic.lines.foreign) == (7, 0)


def test_losses_of_the_followed_publisher_are_seen_beside_another_one():
    topic = Topic(1)
    for t in range(300):
        topic.send("a", t)
    topic.publishers = 2
    topic.numbers["b"] = 305
    followed = [topic.send("a", 300)]
    for t in range(301, 900):
        assert not topic.send("b", t)
        if t not in (400, 500, 501, 502):
            followed.append(topic.send("a", t, lost={401: 1, 503: 3}.get(t, 0)))
    assert all(followed)
    assert topic.lines.lost == 4


def test_without_numbers_everything_is_taken():
    lines = PublisherLines(lambda: 2)
    assert all(lines.follows(None, t * MS) for t in range(10))


@given(st.integers(0, 3000), st.integers(0, 3), st.lists(st.integers(0, 2), max_size=300))
def test_the_first_publisher_is_followed_whatever_the_order(ahead, lost, order):
    topic = Topic(1)
    topic.numbers = {"a": 5000, "b": 5400 + lost + ahead, "c": 12}
    for t in range(10):
        assert topic.send("a", t)
    topic.publishers = 3
    # Interleaved at random: every one of a's is followed, none of the others.
    topic.numbers["b"] += 10
    for t, who in enumerate(order, 10):
        name = "abc"[who]
        assert topic.send("a", t)
        if name != "a":
            assert not topic.send(name, t)
    assert topic.lines.lost == 0
    assert topic.lines.takeovers == 0


def test_a_publisher_that_falls_silent_loses_the_floor_and_does_not_get_it_back():
    topic = Topic(1)
    for t in range(100):
        topic.send("a", t)
    topic.publishers = 2
    topic.numbers["b"] = 3
    assert [topic.send("b", t) for t in (150, 200, 300)] == [False] * 3
    assert topic.send("b", 400)  # 301 ms after the last of a
    assert topic.lines.takeovers == 1
    assert topic.lines.speaking(400 * MS, 350 * MS) == 1
    assert topic.lines.speaking(400 * MS, 1000 * MS) == 1
    assert not topic.send("a", 401)
    assert topic.lines.speaking(401 * MS, 1000 * MS) == 2
    topic.publishers = 1
    assert topic.send("b", 402)
    assert topic.lines.speaking(402 * MS, 1000 * MS) == 1


def test_memory_is_bounded():
    topic = Topic(100)
    topic.send("a", 0)
    for i in range(1000):
        topic.lines.follows(10**6 * (i + 1), MS)
        topic.send("a", 1)
    assert len(topic.lines._others) <= MOST_LINES
    assert topic.lines.foreign == 1000
