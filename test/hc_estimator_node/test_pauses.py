"""What is due now and then is done after a sample, and not while another one waits."""

from types import SimpleNamespace

from hc_estimator.ros.sample_flow import SampleFlow


class Work:
    """A status and a look, each of two parts."""

    def __init__(self, log, name):
        self.log, self.name, self.left = log, name, 2

    @property
    def due(self):
        return self.left > 0

    looking = due

    def go_on(self):
        self.left -= 1
        self.log.append(self.name)

    def add(self, *_sample):
        pass


def test_each_pause_has_a_part_and_the_status_comes_first():
    log = []
    flow = SampleFlow()
    flow._keeper = SimpleNamespace(on_trial=False)
    flow._session = SimpleNamespace(
        process=lambda *_sample: log.append("sample"), contacts=SimpleNamespace(current=None)
    )
    flow._zeros = SimpleNamespace(add=lambda *_sample: None)
    flow._diagnostics, flow._suspicions = Work(log, "status"), Work(log, "look")
    channel = SimpleNamespace(waits=False)
    flow._input = SimpleNamespace(channels=[SimpleNamespace(waits=False), channel])
    for waits in (False, True, False, False, False, False):
        channel.waits = waits
        flow.on_sample(0, 0, 1.0, 2.0)
    assert log == [
        *("sample", "status"),
        "sample",
        *("sample", "status"),
        *("sample", "look"),
        *("sample", "look"),
        "sample",
    ]
