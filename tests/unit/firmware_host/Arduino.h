// As much of Arduino as the sketches use, on a computer: time passes when it is asked for, the port is stdout.
#ifndef HOST_ARDUINO_H
#define HOST_ARDUINO_H

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <string>

static const uint8_t A0 = 14, A1 = 15, A2 = 16;

extern double host_ms;
inline uint32_t millis() {
  host_ms += 0.01;
  return static_cast<uint32_t>(host_ms);
}
inline uint32_t micros() { return static_cast<uint32_t>(host_ms * 1000.0); }
inline void delay(uint32_t ms) { host_ms += ms; }
inline int analogRead(uint8_t pin) {
  host_ms += 0.11;
  return 100 * (pin - A0 + 1);
}

class HostSerial {
 public:
  void begin(uint32_t) {}
  size_t write(char one) { return fwrite(&one, 1, 1, stdout); }
  int available() { return static_cast<int>(input.size()); }
  int read() {
    if (input.empty()) return -1;
    const char one = input[0];
    input.erase(0, 1);
    return one;
  }
  std::string input;
};
extern HostSerial Serial;

#endif
