"""Readings from a real broker, amqtt: Home Assistant's topics, JSON, and a broker that goes and comes back."""

import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec

import pytest

from lidarspectra.errors import DeviceError
from lidarspectra.hardware.incoming.mqtt_source import Broker, MqttSource, Topic

mqtt = pytest.importorskip("paho.mqtt.client", reason="paho-mqtt, of the extra 'mqtt', is not installed")
if find_spec("amqtt") is None:
    pytest.skip("amqtt, of the extra 'broker', is not installed", allow_module_level=True)

PATIENCE_S = 60.0
BROKER = '''
import asyncio, sys
from amqtt.broker import Broker

class StandardBroker(Broker):
    """Sends what it held for a session as any other message [MQTT-3.3.1-9]; amqtt flags it as retained."""

    async def _publish_session_retained_messages(self, session):
        handler = self._get_handler(session)
        while not session.retained_messages.empty():
            held = await session.retained_messages.get()
            await handler.mqtt_publish(held.topic, held.data, held.qos, retain=False)

async def serve():
    listen = {"default": {"type": "tcp", "bind": "127.0.0.1:" + sys.argv[1]}}
    allowed = {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": False}}
    await StandardBroker({"listeners": listen, "plugins": allowed}).start()
    await asyncio.Event().wait()

asyncio.run(serve())
'''


class RealBroker:
    """amqtt in a process of its own on a port of this machine, to be killed and started again."""

    def __init__(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]

    def start(self) -> None:
        self._process = subprocess.Popen([sys.executable, "-c", BROKER, str(self.port)], stderr=subprocess.DEVNULL)
        end = time.monotonic() + PATIENCE_S
        while True:
            try:
                socket.create_connection(("127.0.0.1", self.port), timeout=1.0).close()
            except OSError:
                assert time.monotonic() < end
                time.sleep(0.05)
            else:
                return

    def stop(self) -> None:
        self._process.kill()
        self._process.wait(PATIENCE_S)


@pytest.fixture
def broker() -> Iterator[RealBroker]:
    running = RealBroker()
    running.start()
    yield running
    running.stop()


@pytest.fixture
def publish(broker: RealBroker) -> Callable[..., None]:
    """Publish as a sensor does, retained where Home Assistant's sensors are."""

    def send(topic: str, payload: str, *, retain: bool = False) -> None:
        client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        client.username_pw_set("sensor", "secret")
        client.connect("127.0.0.1", broker.port)
        client.loop_start()
        client.publish(topic, payload, qos=1, retain=retain).wait_for_publish(PATIENCE_S)
        client.disconnect()
        client.loop_stop()

    return send


def source(broker: RealBroker, *topics: Topic) -> MqttSource:
    login = {"username": "live", "password": "secret"}
    return MqttSource(Broker(host="127.0.0.1", port=broker.port, client_id="test", **login), topics)


PANEL = Topic(topic="panel", sensor="panel 1", quantity="state")  # what is retained of it says that it is subscribed


def is_subscribed(heard) -> bool:
    return any(each.sensor == "panel 1" for each in heard.arrivals)


def lux(heard) -> list[float]:
    return [each.values["lux"] for each in heard.arrivals if each.sensor == "desk"]


def test_home_assistants_sensors_arrive_with_their_values(broker, publish, running) -> None:
    topics = [
        Topic(topic="homeassistant/sensor/desk/state", sensor="desk", quantity="lux", template="{{ value_json.lux }}"),
        Topic(topic="homeassistant/light/panel/state", sensor="panel 1", quantity="state"),
        Topic(topic="as7265x/410", sensor="shelf", quantity="410", factor=0.01),
    ]
    publish("homeassistant/light/panel/state", "ON", retain=True)
    with running(source(broker, *topics)) as heard:
        heard.until(lambda heard: len(heard.arrivals) >= 1)  # what the broker had kept: so it is subscribed
        publish("homeassistant/sensor/desk/state", '{"lux": 312.5, "battery": 77}')
        publish("homeassistant/sensor/desk/state", "unavailable")
        publish("as7265x/410", "2.5")
        publish("as7265x/435", "1.0")  # nobody asked for it
        heard.until(lambda heard: len(heard.arrivals) >= 3)
    found = [(each.sensor, dict(each.values)) for each in heard.arrivals]
    assert found == [("panel 1", {"state": 1.0}), ("desk", {"lux": 312.5}), ("shelf", {"410": 0.025})]
    assert heard.notices == []


def test_what_is_no_reading_is_said_once(broker, publish, running) -> None:
    publish("panel", "ON", retain=True)
    with running(source(broker, PANEL, Topic(topic="desk", sensor="desk", quantity="lux"))) as heard:
        heard.until(is_subscribed)
        for payload in ("bright", "brighter", "8"):
            publish("desk", payload)
        heard.until(lambda heard: len(heard.arrivals) >= 2)
    assert lux(heard) == [8.0]
    assert len(heard.notices) == 1
    assert "topic 'desk' is no reading" in heard.notices[0].text


def test_what_a_broker_kept_of_a_sensor_is_no_reading_of_now(broker, publish, running) -> None:
    publish("desk", "7", retain=True)  # a week ago, say, and the sensor is dead
    publish("panel", "ON", retain=True)
    desk = Topic(topic="desk", sensor="desk", quantity="lux")
    with running(source(broker, desk, PANEL)) as heard:
        heard.until(is_subscribed)
        heard.until(lambda heard: heard.notices)
        publish("desk", "8", retain=True)
        heard.until(lambda heard: len(heard.arrivals) >= 2)
    assert lux(heard) == [8.0]
    assert "What the broker kept of topic 'desk' is of unknown age" in heard.notices[0].text


@pytest.mark.slow  # the client waits a second or more before it tries again, as it should
def test_a_broker_that_goes_is_said_once_and_found_again(broker, publish, running) -> None:
    publish("panel", "ON", retain=True)
    with running(source(broker, PANEL, Topic(topic="desk", sensor="desk", quantity="lux"))) as heard:
        heard.until(is_subscribed)
        broker.stop()
        heard.until(lambda heard: len(heard.notices) >= 1)
        broker.start()
        heard.until(lambda heard: len(heard.notices) >= 2)
        publish("desk", "9")
        heard.until(lambda heard: 9.0 in lux(heard))
    first, second = heard.notices
    assert "tried again until it answers" in first.text
    assert "connected again" in second.text


@pytest.mark.slow  # the same
def test_a_broker_that_is_not_there_yet_is_waited_for(broker, publish, running) -> None:
    broker.stop()
    with running(source(broker, Topic(topic="desk", sensor="desk", quantity="lux"))) as heard:
        heard.until(lambda heard: len(heard.notices) >= 1)
        broker.start()
        heard.until(lambda heard: len(heard.notices) >= 2)
        publish("desk", "9")
        heard.until(lambda heard: heard.arrivals)
    assert heard.lux() == [9.0]


def test_a_topic_with_a_wildcard_is_refused() -> None:
    with pytest.raises(DeviceError, match="without wildcards"):
        MqttSource(Broker(host="localhost"), [Topic(topic="home/+/lux", sensor="desk", quantity="lux")])


def test_what_is_published_while_nobody_listens_is_kept_by_the_broker(broker, publish, running) -> None:
    topics = (Topic(topic="desk", sensor="desk", quantity="lux"), PANEL)
    publish("panel", "ON", retain=True)
    with running(source(broker, *topics)) as heard:
        heard.until(is_subscribed)
    for number in (2, 3, 4):
        publish("desk", str(number))
    with running(source(broker, *topics)) as heard:
        heard.until(lambda heard: {2.0, 3.0, 4.0} <= set(lux(heard)))
    assert lux(heard) == [2.0, 3.0, 4.0]  # in their order, each once
    assert "the broker held them while nobody listened" in heard.notices[0].text


def test_a_login_that_is_refused_is_said(broker, running) -> None:
    nobody = MqttSource(
        Broker(host="127.0.0.1", port=broker.port), [Topic(topic="desk", sensor="desk", quantity="lux")]
    )
    with running(nobody) as heard:
        heard.until(lambda heard: heard.notices)
    assert "refuses the connection" in heard.notices[0].text
