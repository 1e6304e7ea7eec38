// The AS7265x over I2C: virtual registers behind three real ones, each access with a limit in time.
//
// Facts from the data sheet DS000612 (ams, 2018): address 0x49; the master AS72651 passes what is asked on to its
// two slaves, chosen by register 0x4F.
#ifndef LIDARSPECTRA_AS7265X_H
#define LIDARSPECTRA_AS7265X_H

#include <Arduino.h>
#include <Wire.h>
#include <string.h>

class As7265x {
 public:
  static const uint8_t DIES = 3;
  static const uint8_t CHANNELS_OF_DIE = 6;

  // True if all three dies are there, after setting them up: all six channels, continuously; all lights off.
  bool begin() {
    Wire.beginTransmission(ADDRESS);
    if (Wire.endTransmission() != 0) return false;
    has_failed_ = false;
    const uint8_t present = read(DEVICE_SELECT);
    if (has_failed_ || (present & 0x30) != 0x30) return false;
    for (uint8_t die = 0; die < DIES; ++die) {
      write(DEVICE_SELECT, die);
      write(LED_CONTROL, 0);  // its indicator and lamps would be measured
    }
    write(DEVICE_SELECT, 0);
    change(CONTROL, 0x0C, 0x08);  // bank mode 2
    return !has_failed_;
  }

  // Gain code 0 to 3; what the sensor has then, or 255.
  uint8_t set_gain(uint8_t code) {
    change(CONTROL, 0x30, static_cast<uint8_t>(code << 4));
    const uint8_t is = static_cast<uint8_t>(read(CONTROL) >> 4 & 0x03);
    return has_failed_ ? 255 : is;
  }

  // Integration steps of 2.8 ms, 1 to 255; what the sensor has then, or 0.
  uint8_t set_integration(uint8_t steps) {
    write(INTEGRATION, steps);
    const uint8_t is = read(INTEGRATION);
    return has_failed_ ? 0 : is;
  }

  // Gain code that the sensor has.
  uint8_t gain() { return static_cast<uint8_t>(read(CONTROL) >> 4 & 0x03); }

  // Integration steps that the sensor has.
  uint8_t integration() { return read(INTEGRATION); }

  // Read one die: six counts, six values of the module's own, its temperature. False if the sensor did not answer.
  bool read_die(uint8_t die, uint16_t *counts, float *values, uint8_t *temperature) {
    write(DEVICE_SELECT, die);
    for (uint8_t i = 0; i < CHANNELS_OF_DIE; ++i) {
      const uint8_t high = read(static_cast<uint8_t>(COUNTS + 2 * i));
      const uint8_t low = read(static_cast<uint8_t>(COUNTS + 2 * i + 1));
      counts[i] = static_cast<uint16_t>(high << 8 | low);
    }
    for (uint8_t i = 0; i < CHANNELS_OF_DIE; ++i) {
      uint32_t bits = 0;
      for (uint8_t part = 0; part < 4; ++part) bits = bits << 8 | read(static_cast<uint8_t>(VALUES + 4 * i + part));
      memcpy(&values[i], &bits, 4);
    }
    *temperature = read(TEMPERATURE);
    return !has_failed_;
  }

  // Whether an access failed since begin().
  bool has_failed() const { return has_failed_; }

 private:
  static const uint8_t ADDRESS = 0x49;
  static const uint8_t STATUS = 0x00, WRITE = 0x01, READ = 0x02;  // real registers
  static const uint8_t CONTROL = 0x04, INTEGRATION = 0x05, TEMPERATURE = 0x06, LED_CONTROL = 0x07;  // virtual ones
  static const uint8_t COUNTS = 0x08, VALUES = 0x14, DEVICE_SELECT = 0x4F;
  static const uint8_t MAY_NOT_WRITE = 0x02, MAY_READ = 0x01;  // bits of STATUS
  static const uint16_t LIMIT_MS = 50;  // an access takes a few milliseconds

  void change(uint8_t name, uint8_t mask, uint8_t bits) {
    const uint8_t before = read(name);
    write(name, static_cast<uint8_t>((before & ~mask) | bits));
  }

  uint8_t real(uint8_t name) {
    Wire.beginTransmission(ADDRESS);
    Wire.write(name);
    if (Wire.endTransmission() != 0 || Wire.requestFrom(ADDRESS, static_cast<uint8_t>(1)) != 1) {
      has_failed_ = true;
      return 0;
    }
    return static_cast<uint8_t>(Wire.read());
  }

  void put(uint8_t name, uint8_t value) {
    Wire.beginTransmission(ADDRESS);
    Wire.write(name);
    Wire.write(value);
    if (Wire.endTransmission() != 0) has_failed_ = true;
  }

  // Wait until a bit of STATUS is as wanted; false after the limit.
  bool wait(uint8_t bit, bool wanted) {
    const uint32_t start = millis();
    while (!has_failed_) {
      if (((real(STATUS) & bit) != 0) == wanted) return true;
      if (millis() - start > LIMIT_MS) has_failed_ = true;
    }
    return false;
  }

  uint8_t read(uint8_t name) {
    if (has_failed_) return 0;
    if (real(STATUS) & MAY_READ) real(READ);  // what an access that was cut short left there
    if (!wait(MAY_NOT_WRITE, false)) return 0;
    put(WRITE, name);
    if (!wait(MAY_READ, true)) return 0;
    return real(READ);
  }

  void write(uint8_t name, uint8_t value) {
    if (has_failed_ || !wait(MAY_NOT_WRITE, false)) return;
    put(WRITE, static_cast<uint8_t>(name | 0x80));
    if (!wait(MAY_NOT_WRITE, false)) return;
    put(WRITE, value);
  }

  bool has_failed_ = false;
};

#endif
