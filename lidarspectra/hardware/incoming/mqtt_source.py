"""An MQTT broker as a source of readings, with the extra `mqtt`.

The session is persistent and every topic is subscribed to with quality of service 1: a broker that keeps sessions holds
what is published while the connection is down, and delivers it afterwards, all at once: no message of MQTT 3.1.1 says
when it was published. What a broker retains of a topic, for whoever subscribes, may be of a sensor that has been dead
for days: it is taken for the state of a switch, and for no reading.
"""

import math
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from lidarspectra.errors import DeviceError
from lidarspectra.hardware.incoming.arrivals import BACK_OFF_S, NODE_TIME, STATE, Arrival, Notice, Put, Stop, pause
from lidarspectra.hardware.incoming.payloads import Reader, value_reader

KEEPALIVE_S = 30  # [s] a broker that is silent for one and a half of these is gone
QUALITY = 1  # of service: at least once
MAX_PAYLOAD_BYTES = 1 << 16
HELD_S, HELD_MESSAGES = (
    1.0,
    3,
)  # [s], of one topic: so many so soon after a session goes on were held by the broker


@dataclass(frozen=True, kw_only=True)
class Broker:
    """Where a broker is, and how to log in.

    Parameters
    ----------
    host : str
    port : int
    username, password : str or None
    tls : bool
        Encrypt, and check the broker's certificate by the system's authorities.
    client_id : str
        By which the broker knows the session again.
    """

    host: str
    port: int = 1883
    username: str | None = None
    password: str | None = field(default=None, repr=False)
    tls: bool = False
    client_id: str = "lidarspectra-live"


@dataclass(frozen=True, kw_only=True)
class Topic:
    """A topic, and what its payloads say.

    Parameters
    ----------
    topic : str
        Without wildcards.
    sensor : str
        Name of the sensor, or of a switch's lamp.
    quantity : str
        Key in `Arrival.values`.
    template : str or None
        See `payloads.value_reader`.
    factor : float
        From the payload's unit to ours. [1]
    """

    topic: str
    sensor: str
    quantity: str
    template: str | None = None
    factor: float = 1.0


class MqttSource:
    """A source: topics of a broker.

    Parameters
    ----------
    broker : Broker
    topics : sequence of Topic

    Raises
    ------
    DeviceError
        If paho-mqtt is not installed, or a topic has a wildcard.
    ReadingError
        If a template is not known.
    """

    def __init__(self, broker: Broker, topics: Sequence[Topic]) -> None:
        self._paho = _paho()
        self._broker = broker
        self._readers: dict[str, list[tuple[Topic, Reader]]] = {}
        for topic in topics:
            if not topic.topic or {"+", "#"} & set(topic.topic):
                raise DeviceError(
                    expected="a topic without wildcards",
                    found=f"'{topic.topic}'",
                    where=f"sensor '{topic.sensor}'",
                    todo="Name the topic of this one sensor.",
                )
            self._readers.setdefault(topic.topic, []).append((topic, value_reader(topic.template)))
        self._said: set[str] = set()
        self._is_lost = False
        self._connected_s = -math.inf
        self._early: Counter[str] = Counter()

    @property
    def name(self) -> str:
        """The broker's address."""
        return f"mqtt://{self._broker.host}:{self._broker.port}"

    def run(self, put: Put, stop: Stop) -> None:
        """Give readings; a broker that is gone is tried again with growing waits, said once."""
        client = self._client(put)
        client.connect_async(self._broker.host, self._broker.port, KEEPALIVE_S)
        client.loop_start()
        try:
            while not stop():
                pause(1.0, stop)
        finally:
            client.disconnect()
            client.loop_stop()

    def _client(self, put: Put) -> Any:
        broker = self._broker
        client = self._paho.Client(
            self._paho.CallbackAPIVersion.VERSION2,
            client_id=broker.client_id,
            clean_session=False,
            protocol=self._paho.MQTTv311,
        )
        client.reconnect_delay_set(min_delay=int(BACK_OFF_S[0]), max_delay=int(BACK_OFF_S[-1]))
        if broker.username is not None:
            client.username_pw_set(broker.username, broker.password)
        if broker.tls:
            client.tls_set()

        def connected(caller: Any, data: object, flags: Any, reason: Any, properties: object) -> None:
            if reason.is_failure:
                self._lost(put, f"The broker refuses the connection ({reason})")
                return
            self._connected_s = time.monotonic() if flags.session_present else -math.inf
            self._early.clear()
            caller.subscribe([(topic, QUALITY) for topic in self._readers])

        def subscribed(caller: Any, data: object, number: int, reasons: Sequence[Any], properties: object) -> None:
            for topic, reason in zip(self._readers, reasons, strict=False):
                if reason.is_failure:
                    put(Notice(source=self.name, text=f"The broker refuses the topic '{topic}' ({reason})."))
            if self._is_lost:
                put(Notice(source=self.name, text="The broker is connected again."))
            self._is_lost = False

        def disconnected(caller: Any, data: object, flags: object, reason: Any, properties: object) -> None:
            if reason.is_failure:
                self._lost(put, f"The connection to the broker broke ({reason})")

        client.on_connect, client.on_subscribe, client.on_disconnect = connected, subscribed, disconnected
        client.on_connect_fail = lambda caller, data: self._lost(put, "The broker cannot be reached")

        def received(caller: Any, data: object, message: Any) -> None:
            self._take(message.topic, message.payload, put, is_retained=message.retain)

        client.on_message = received
        return client

    def _lost(self, put: Put, words: str) -> None:
        if not self._is_lost:
            put(Notice(source=self.name, text=f"{words}; it is tried again until it answers."))
        self._is_lost = True

    def _take(self, name: str, payload: bytes, put: Put, *, is_retained: bool = False) -> None:
        now_s = time.time()
        self._look_for_held(name, put)
        values: dict[str, dict[str, float]] = {}
        for topic, reader in self._readers.get(name, []):
            if is_retained and topic.quantity != STATE:
                self._say_once(put, f"retained {name}", f"What the broker kept of topic '{name}' is of unknown age")
                continue
            try:
                number = topic.factor * reader(payload[:MAX_PAYLOAD_BYTES].decode("utf-8"))
            except (
                ValueError,
                TypeError,
                ArithmeticError,
                RecursionError,
            ) as cause:  # JSON's and Unicode's are ValueErrors
                self._say_once(put, name, f"'{payload[:60]!r}' at topic '{name}' is no reading ({cause})")
                continue
            if math.isfinite(number):
                values.setdefault(topic.sensor, {})[topic.quantity] = number
        for sensor, each in values.items():
            device_s = each.pop(NODE_TIME, None)
            if each:
                put(Arrival(sensor=sensor, values=each, unix_s=now_s, device_s=device_s))

    def _look_for_held(self, topic: str, put: Put) -> None:
        """Say that readings were held, once for each connection: their times are those of their arrival."""
        if time.monotonic() - self._connected_s > HELD_S or HELD_MESSAGES in self._early.values():
            return
        self._early[topic] += 1
        if self._early[topic] == HELD_MESSAGES:
            words = f"Readings of topic '{topic}' and maybe others came at once: the broker held them while nobody "
            put(Notice(source=self.name, text=f"{words}listened. Their times are those of their arrival."))

    def _say_once(self, put: Put, about: str, words: str) -> None:
        if about not in self._said:
            self._said.add(about)
            put(Notice(source=self.name, text=f"{words}; it is left out, and this is said once."))


def _paho() -> ModuleType:
    try:
        from paho.mqtt import client
    except ImportError as cause:
        raise DeviceError(
            expected="paho-mqtt, for readings from a broker",
            found=str(cause),
            where="MQTT",
            todo="Install it: pip install 'lidarspectra[mqtt]'.",
        ) from cause
    module: ModuleType = client
    return module
