// An I2C bus with an AS7265x on it: three real registers, virtual ones behind them, three dies.
#ifndef HOST_WIRE_H
#define HOST_WIRE_H

#include <stdint.h>
#include <string.h>

class HostWire {
 public:
  HostWire() { power_on(); }
  void begin() {}
  void setClock(uint32_t) {}

  void power_on() {
    memset(shared_, 0, sizeof(shared_));
    shared_[0x05] = 20;
    selected_ = 0;
    address_ = 0;
    is_readable_ = false;
    awaits_value_ = false;
  }

  void beginTransmission(uint8_t address) {
    is_mine_ = address == 0x49 && !is_missing;
    length_ = 0;
  }
  size_t write(uint8_t value) {
    if (length_ < 2) sent_[length_++] = value;
    return 1;
  }
  uint8_t endTransmission() {
    if (!is_mine_) return 2;
    if (length_ >= 1) pointer_ = sent_[0];
    if (length_ == 2 && pointer_ == 0x01) take(sent_[1]);
    return 0;
  }
  uint8_t requestFrom(uint8_t address, uint8_t) { return address == 0x49 && !is_missing ? 1 : 0; }
  int read() {
    if (pointer_ == 0x00) return is_readable_ ? 0x01 : 0x00;
    is_readable_ = false;
    return value_;
  }

  bool is_missing = false;
  bool lights_are_off = false;

 private:
  void take(uint8_t byte) {
    if (awaits_value_) {
      awaits_value_ = false;
      if (address_ == 0x4F) {
        selected_ = byte;
      } else {
        shared_[address_] = byte;
        if (address_ == 0x07) lights_are_off = byte == 0;
      }
      return;
    }
    address_ = byte & 0x7F;
    if (byte & 0x80) {
      awaits_value_ = true;
      return;
    }
    value_ = looked_up();
    is_readable_ = true;
  }

  // Counts 1000 (die + 1) + channel, module values half of that.
  uint8_t looked_up() const {
    if (address_ == 0x4F) return 0x30 | selected_;
    if (address_ == 0x06) return static_cast<uint8_t>(30 + selected_);
    if (address_ >= 0x08 && address_ < 0x14) {
      const uint16_t count = static_cast<uint16_t>(1000 * (selected_ + 1) + (address_ - 0x08) / 2);
      return address_ % 2 ? count & 0xFF : count >> 8;
    }
    if (address_ >= 0x14 && address_ < 0x2C) {
      const uint8_t channel = static_cast<uint8_t>((address_ - 0x14) / 4), part = (address_ - 0x14) % 4;
      float half = (1000.0f * static_cast<float>(selected_ + 1) + channel) / 2.0f;
      if (selected_ == 2 && channel == 5) half = 4294967296.0f;
      if (selected_ == 2 && channel == 4) half = NAN;
      uint32_t bits;
      memcpy(&bits, &half, 4);
      return static_cast<uint8_t>(bits >> (8 * (3 - part)));
    }
    return shared_[address_];
  }

  uint8_t shared_[128], sent_[2], selected_, address_, value_ = 0, pointer_ = 0, length_ = 0;
  bool is_readable_, awaits_value_, is_mine_ = false;
};
extern HostWire Wire;

#endif
