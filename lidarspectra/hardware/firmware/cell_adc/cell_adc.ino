// LiDARSpectra: solar cells on the analog inputs of an Arduino, in lines with names, units, numbers and checksums.
//
// Wiring (Arduino Uno): each cell's plus to A0, A1, A2, its minus to GND, and its shunt resistor across it. Choose the
// shunt so that the cell drops less than half of its open-circuit voltage. 115200 baud. See README.md beside this folder.

#include "board.h"
#include "line_protocol.h"

static const char DEVICE[] = "adc";
static const uint8_t CELLS = 3;
static const uint8_t INPUTS[CELLS] = {A0, A1, A2};
static const uint32_t BAUD = 115200;
static const uint8_t HEADER_EVERY = 30;                         // readings
static const uint32_t SHORTEST_MS = 200, LONGEST_MS = 3600000;  // between readings; one takes 0.1 s
static const uint32_t WINDOW_MS = 100;  // whole periods of the light's flicker at 50 and at 60 Hz mains
static const uint8_t BITS = 10;
static const uint32_t BANDGAP_MV = 1100;  // the ATmega328P's own reference, +-10 % from chip to chip (its data sheet)

CommandReader commands;
uint16_t boot;
uint32_t sequence = 0, period_ms = 1000, due_ms, reference_mv;

typedef Frame<decltype(Serial)> Line;

// Supply voltage, which is the converter's reference, by measuring the chip's own reference with it.
uint32_t measure_reference_mv() {
#if defined(__AVR_ATmega328P__)
  ADMUX = _BV(REFS0) | _BV(MUX3) | _BV(MUX2) | _BV(MUX1);
  delay(5);
  uint32_t total = 0;
  for (uint8_t i = 0; i < 16; ++i) {
    ADCSRA |= _BV(ADSC);
    while (ADCSRA & _BV(ADSC)) {
    }
    total += ADC;
  }
  return total ? BANDGAP_MV * 1024UL * 16UL / total : 0;
#else
  return 5000;
#endif
}

void send_header() {
  Line line(Serial);
  line.field().text("H").field().text("1").field().text(DEVICE).field().whole(boot).field().text("C");
  for (uint8_t cell = 1; cell <= CELLS; ++cell) line.field().text("cell_").whole(cell).text(":count");
  line.field().text("reference_mV=").whole(reference_mv).field().text("bits=").whole(BITS);
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

void obey(const Command &command) {
  if (command.name == '?' && !command.has_value) {
    send_header();
  } else if (command.name == 'P' && command.value >= SHORTEST_MS && command.value <= LONGEST_MS) {
    period_ms = command.value;
    due_ms = millis() + period_ms;
    send_answer('P', period_ms, true);
  } else {
    const char name = command.name;
    const bool is_printable = name > ' ' && name <= '~' && name != ',' && name != '*' && name != '$';
    send_answer(is_printable ? name : '!', 0, false);
  }
}

// Mean of all samples in the window, cell after cell in turn.
void send_reading() {
  uint32_t totals[CELLS] = {0}, samples = 0;
  const uint32_t start = millis();
  while (millis() - start < WINDOW_MS && samples < 4000000) {
    for (uint8_t cell = 0; cell < CELLS; ++cell) totals[cell] += static_cast<uint32_t>(analogRead(INPUTS[cell]));
    ++samples;
  }
  Line line(Serial);
  line.field().text("D").field().whole(boot).field().text("C").field().whole(sequence).field().whole(start);
  for (uint8_t cell = 0; cell < CELLS; ++cell) {
    line.field().decimal(static_cast<float>(totals[cell]) / static_cast<float>(samples));
  }
  line.end();
  ++sequence;
}

void setup() {
  Serial.begin(BAUD);
  boot = count_start();
  reference_mv = measure_reference_mv();
  for (uint8_t cell = 0; cell < CELLS; ++cell) analogRead(INPUTS[cell]);  // the converter settles on its inputs again
  Line line(Serial);
  line.field().text("E").field().whole(boot).field().whole(millis()).field().text("boot");
  line.end();
  send_header();
  due_ms = millis() + period_ms;
}

void loop() {
  while (Serial.available() > 0) {
    Command command;
    if (commands.take(static_cast<char>(Serial.read()), command)) obey(command);
  }
  const uint32_t now = millis();
  if (static_cast<int32_t>(now - due_ms) < 0) return;
  due_ms += period_ms;
  if (static_cast<int32_t>(now - due_ms) > 0) due_ms = now + period_ms;
  if (sequence % HEADER_EVERY == HEADER_EVERY - 1) send_header();
  send_reading();
}
