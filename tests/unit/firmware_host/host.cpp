// Runs a sketch for so many milliseconds; lines "MILLISECONDS COMMAND" on stdin are sent to it at their time. The
// commands `pull` and `plug` take the sensor off its bus and put it back, unpowered meanwhile.
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <utility>
#include <vector>

#include "Arduino.h"
#include "EEPROM.h"
#include "Wire.h"

double host_ms = 0.0;
HostSerial Serial;
HostWire Wire;
HostEeprom EEPROM;

#include SKETCH

int main(int, char **argv) {
  const double end_ms = atof(argv[1]);
  EEPROM.cells[0] = static_cast<uint8_t>(atoi(argv[2]));
  std::vector<std::pair<double, std::string>> script;
  double at_ms;
  std::string command;
  while (std::cin >> at_ms >> command) script.emplace_back(at_ms, command);
  size_t next = 0;
  setup();
  while (host_ms < end_ms) {
    for (; next < script.size() && script[next].first <= host_ms; ++next) {
      if (script[next].second == "pull") {
        Wire.is_missing = true;
      } else if (script[next].second == "plug") {
        Wire.is_missing = false;
        Wire.power_on();
      } else {
        Serial.input += script[next].second + "\n";
      }
    }
    loop();
    host_ms += 0.5;
  }
  return 0;
}
