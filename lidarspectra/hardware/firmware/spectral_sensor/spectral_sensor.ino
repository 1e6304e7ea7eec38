// LiDARSpectra: the AS7265x spectral sensor on an Arduino, in lines with names, units, numbers and checksums.
//
// Wiring (Arduino Uno, SparkFun board SEN-15050): 3.3V - 3V3, GND - GND, SDA - A4, SCL - A5. The sensor takes 3.3 V; a
// board of 5 V needs a level shifter on SDA and SCL. 115200 baud. README.md beside this folder tells the protocol.

#include "as7265x.h"
#include "board.h"
#include "line_protocol.h"

static const char DEVICE[] = "as7265x";
static const uint32_t BAUD = 115200;
static const uint8_t HEADER_EVERY = 30;                    // readings
static const uint32_t SHORTEST_MS = 500, LONGEST_MS = 3600000;  // between readings; one takes up to 0.4 s
static const uint8_t SETTLING = 3;                         // integrations until nothing of the old settings is left
static const float STEP_MS = 2.8f, GAINS[] = {1.0f, 3.7f, 16.0f, 64.0f};
// die by die, as they are read
static const char LETTERS[] = "RSTUVWGHIJKLABCDEF";
static const uint16_t WAVELENGTHS[] = {610, 680, 730, 760, 810, 860, 560, 585, 645, 705, 900, 940, 410, 435, 460, 485, 510, 535};

As7265x sensor;
CommandReader commands;
uint16_t boot;
uint32_t sequence = 0, period_ms = 1000, due_ms, settled_ms = 0;
uint8_t gain_code = 2, steps = 59;
bool is_ready = false;

typedef Frame<decltype(Serial)> Line;

void send_header() {
  Line line(Serial);
  line.field().text("H").field().text("1").field().text(DEVICE).field().whole(boot).field().text("S");
  line.field().text("gain:1").field().text("integration:ms");
  for (uint8_t die = 1; die <= As7265x::DIES; ++die) line.field().text("temperature_").whole(die).text(":degC");
  for (uint8_t part = 0; part < 2; ++part) {
    for (uint8_t i = 0; i < 18; ++i) {
      line.field().letter(LETTERS[i]).letter('_').whole(WAVELENGTHS[i]).text(part ? ":module" : ":count");
    }
  }
  line.end();
}

void send_event(const char *words) {
  Line line(Serial);
  line.field().text("E").field().whole(boot).field().whole(millis()).field().text(words);
  line.end();
}

void send_answer(char name, uint32_t value, bool is_done) {
  Line line(Serial);
  line.field().text("A").field().whole(boot).field().letter(name).field();
  if (is_done) {
    line.whole(value);
  } else {
    line.text("ERROR");
  }
  line.end();
}

// Wait until nothing of the old settings is left in what the sensor measures.
void settle() { settled_ms = millis() + static_cast<uint32_t>(SETTLING * STEP_MS * steps) + 1; }

bool set_up() {
  is_ready = sensor.begin() && sensor.set_gain(gain_code) == gain_code && sensor.set_integration(steps) == steps;
  settle();
  return is_ready;
}

void obey(const Command &command) {
  if (command.name == '?' && !command.has_value) {
    send_header();
  } else if (command.name == 'P' && command.value >= SHORTEST_MS && command.value <= LONGEST_MS) {
    period_ms = command.value;
    due_ms = millis() + period_ms;
    send_answer('P', period_ms, true);
  } else if (command.name == 'G' && command.has_value && command.value <= 3) {
    gain_code = static_cast<uint8_t>(command.value);
    const bool is_done = is_ready && sensor.set_gain(gain_code) == gain_code;
    settle();
    send_answer('G', gain_code, is_done);
  } else if (command.name == 'I' && command.value >= 1 && command.value <= 255) {
    steps = static_cast<uint8_t>(command.value);
    const bool is_done = is_ready && sensor.set_integration(steps) == steps;
    settle();
    send_answer('I', steps, is_done);
  } else {
    const char name = command.name;
    const bool is_printable = name > ' ' && name <= '~' && name != ',' && name != '*' && name != '$';
    send_answer(is_printable ? name : '!', 0, false);
  }
}

void send_reading() {
  uint16_t counts[18];
  float values[18];
  uint8_t temperatures[3];
  const uint32_t now = millis();
  bool is_whole = true;
  for (uint8_t die = 0; die < As7265x::DIES; ++die) {
    is_whole = is_whole && sensor.read_die(die, counts + 6 * die, values + 6 * die, temperatures + die);
  }
  const uint8_t gain_is = sensor.gain(), steps_are = sensor.integration();
  if (!is_whole || sensor.has_failed()) {
    is_ready = false;
    send_event("sensor does not answer");
    return;
  }
  if (gain_is != gain_code || steps_are != steps) {  // it restarted by itself: what it measured with is not known
    send_event("sensor lost its settings");
    set_up();
    return;
  }
  Line line(Serial);
  line.field().text("D").field().whole(boot).field().text("S").field().whole(sequence).field().whole(now);
  line.field().decimal(GAINS[gain_code]).field().decimal(STEP_MS * steps);
  for (uint8_t die = 0; die < As7265x::DIES; ++die) line.field().whole(temperatures[die]);
  for (uint8_t i = 0; i < 18; ++i) line.field().whole(counts[i]);
  for (uint8_t i = 0; i < 18; ++i) line.field().decimal(values[i]);
  line.end();
  ++sequence;
}

void setup() {
  Serial.begin(BAUD);
  boot = count_start();
  Wire.begin();
#if defined(WIRE_HAS_TIMEOUT)
  Wire.setWireTimeout(25000, true);  // a wire that is pulled must not hold the board for ever
#endif
  Wire.setClock(400000);
  send_event("boot");
  send_header();
  if (!set_up()) send_event("sensor missing");
  due_ms = millis() + period_ms;
}

void loop() {
  while (Serial.available() > 0) {
    Command command;
    if (commands.take(static_cast<char>(Serial.read()), command)) obey(command);
  }
  const uint32_t now = millis();
  if (static_cast<int32_t>(now - due_ms) < 0 || static_cast<int32_t>(now - settled_ms) < 0) return;
  due_ms += period_ms;
  if (static_cast<int32_t>(now - due_ms) > 0) due_ms = now + period_ms;  // it was held up: do not hurry after
  if (!is_ready && !set_up()) {
    send_event("sensor missing");
    return;
  }
  if (static_cast<int32_t>(millis() - settled_ms) < 0) return;
  if (sequence % HEADER_EVERY == HEADER_EVERY - 1) send_header();
  send_reading();
}
