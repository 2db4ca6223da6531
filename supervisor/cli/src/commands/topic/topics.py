# The topics of firsthand, for consumers in Python (pip install iceoryx2==0.10.0): structs, and a class that follows a robot.
# `firsthand topic list --python` prints it. Print it again when firsthand is replaced.

import ctypes
import enum
import fcntl
import os
import time


class Struct(ctypes.Structure):
    """A struct of a topic, which prints its fields. Their names end with their units."""

    def __repr__(self):
        values = ((name, getattr(self, name)) for name, _ in self._fields_)
        listed = ((name, list(it) if isinstance(it, ctypes.Array) else it) for name, it in values)
        return f"{type(self).__name__}({', '.join(f'{name}={it!r}' for name, it in listed)})"

    def copy(self):
        return type(self).from_buffer_copy(self)

def places():
    """The directories in which robots of this user may be, the first to be taken if there is none yet."""
    user = os.geteuid()
    home = os.path.expanduser("~/.firsthand")
    places = [f"/tmp/firsthand-{user}", "/run/firsthand", f"/run/user/{user}/firsthand", home]
    # Another user may have made a directory of such a name.
    own = [place for place in places if os.path.isdir(place) and os.lstat(place).st_uid == user]
    return own or places


def series(version):
    """A version without what may differ between two that understand each other."""
    major, minor = (version.split(".") + [""])[:2]
    return major, minor if major == "0" else ""


class Follower:
    """Follows a robot from run to run.

    `for event, sample in Follower("x80", ["pose", "grid"])` yields the events "here", "gone" and "nothing" (for a second), or the
    name of a topic with one sample: its struct, or its header and an array. Structs and headers are copies. An array lies in memory
    shared with the robot, where a reader holds two at most: let go of one, or copy it, before the next but one comes.
    """

    def __init__(self, robot="x80", topics=("pose",), name="python"):
        import iceoryx2

        self.iox2 = iceoryx2
        iceoryx2.set_log_level(iceoryx2.LogLevel.Fatal)
        self.topics = {topic: TOPICS[topic] for topic in topics}
        self.name = name
        self.robot = robot
        self.node = None
        self.publishers = {}

    def __iter__(self):
        while True:
            instance = self._wait()
            readers = self._join(instance)
            if readers is None:
                time.sleep(0.1)
                continue
            yield "here", None
            self.node, listener, subscribers = readers
            quiet = 0
            while self._instance() == instance:
                came = self._wait_for(listener)
                yield from self._take(subscribers)
                quiet = 0 if came else quiet + 1
                if quiet == 5:
                    quiet = 0
                    if not self._supervised():
                        break
                    yield "nothing", None
            # The last samples of a run that has ended.
            yield from self._take(subscribers)
            self.publishers = {}
            del subscribers, listener, readers
            self.node = None
            yield "gone", None

    def publish(self, topic, sample):
        """Publish a struct on a topic that consumers may write: `fix`, `turn`, `beacon`. Only while the robot is here."""
        iox2 = self.iox2
        if topic not in self.publishers:
            name = iox2.ServiceName.new(topic)
            service = self.node.service_builder(name).publish_subscribe(TOPICS[topic][0]).open()
            event = self.node.service_builder(name).event().open()
            publisher = service.publisher_builder().create(), event.notifier_builder().create()
            self.publishers[topic] = publisher
        publisher, notifier = self.publishers[topic]
        sample.stamp.generation = 1
        publisher.loan_uninit().write_payload(sample).send()
        notifier.notify()

    def _wait_for(self, listener):
        """Wait for samples, 0.2 s at most."""
        try:
            came = listener.timed_wait(self.iox2.Duration.from_millis(200))
            while came and listener.try_wait():
                pass
            return came
        except self.iox2.ListenerWaitError as error:
            # A signal wakes a process that has a handler for it, or that was stopped and goes on.
            if "InterruptSignal" not in str(error):
                raise
            return None

    def _take(self, subscribers):
        for topic, (subscriber, sliced) in subscribers.items():
            while True:
                try:
                    sample = subscriber.receive()
                except Exception as error:
                    if "Borrow" in str(error):
                        raise BufferError(f"two arrays of {topic} are held already: keep copies of them") from error
                    # The writer may have just ended.
                    break
                if sample is None:
                    break
                if sliced:
                    slice = sample.payload()
                    element = self.topics[topic][1]
                    count = slice.len() // ctypes.sizeof(element)
                    elements = (element * count).from_address(slice.as_ptr())
                    # The memory is the writer's again when the array is gone.
                    elements.sample = sample
                    it = sample.user_header().contents.copy(), elements
                    del slice, elements
                else:
                    it = sample.payload().contents.copy()
                del sample
                yield topic, it
                del it

    @property
    def directory(self):
        """The robot's directory: where it is, or else in the first place that is this user's."""
        own = sorted(places(), key=lambda place: not os.path.exists(f"{place}/{self.robot}"))
        return f"{own[0]}/{self.robot}"

    def _instance(self):
        try:
            return os.readlink(f"{self.directory}/iceoryx2.toml")
        except (FileNotFoundError, NotADirectoryError):
            return None

    def _supervised(self):
        """Whether a process holds the supervisor's lock: a supervisor that was killed leaves its bus."""
        try:
            with open(f"{self.directory}/lock") as lock:
                fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
            return False
        except (FileNotFoundError, NotADirectoryError):  # A page keeps a file beside the robots' directories.
            return False
        except BlockingIOError:
            return True

    def _wait(self):
        while True:
            instance = self._instance()
            if instance and self._supervised():
                return instance
            time.sleep(0.1)

    def _join(self, instance):
        """Readers on the bus `instance`; None if its run has just ended."""
        iox2 = self.iox2
        try:
            # Under this lock, which ends with the file, nobody removes the bus until the readers are open.
            with open(f"{self.directory}/joining.lock") as joining:
                fcntl.flock(joining, fcntl.LOCK_SH)
                if self._instance() != instance:
                    return None
                with open(f"{self.directory}/{instance}") as lines:
                    made_by = lines.readline().removeprefix("# firsthand ").strip()
                if series(made_by) != series(VERSION):
                    raise TypeError(
                        f"robot {self.robot!r} runs firsthand {made_by}, and this module is of {VERSION}: take the Python of that version"
                    )
                config = iox2.config.from_file(iox2.FilePath.new(f"{self.directory}/{instance}"))
                builder = iox2.NodeBuilder.new().config(config).name(iox2.NodeName.new(self.name))
                node = builder.signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
                subscribers = {}
                for topic, (payload, element) in self.topics.items():
                    service = node.service_builder(iox2.ServiceName.new(topic))
                    if element is None:
                        service = service.publish_subscribe(payload)
                    else:
                        service = service.publish_subscribe(iox2.Slice[element]).user_header(payload)
                    subscribers[topic] = (service.open().subscriber_builder().create(), element is not None)
                # The link ends a tick; until then the stages need the processor.
                link = node.service_builder(iox2.ServiceName.new("link"))
                listener = link.event().open().listener_builder().create()
                return node, listener, subscribers
        except Exception as error:
            if self._instance() != instance or not self._supervised():
                return None
            if "IncompatibleTypes" in str(error):
                raise TypeError(f"robot {self.robot!r} is driven by another version of firsthand: take the Python of that one") from error
            raise


