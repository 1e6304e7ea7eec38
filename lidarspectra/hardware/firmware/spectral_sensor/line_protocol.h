// The line protocol of LiDARSpectra, for any port that has write(char): `$` body `*` CRC-16 in four digits, CR LF.
//
// The CRC is CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xFFFF) of the body. See README.md for the bodies.
// This file is the same in both sketches. It needs nothing of Arduino, so that it can be tested on a computer.
#ifndef LIDARSPECTRA_LINE_PROTOCOL_H
#define LIDARSPECTRA_LINE_PROTOCOL_H

#include <stdint.h>

template <typename Port>
class Frame {
 public:
  explicit Frame(Port &port) : port_(port), crc_(0xFFFF), is_first_(true) { port_.write('$'); }

  // Begin the next field.
  Frame &field() {
    if (!is_first_) put(',');
    is_first_ = false;
    return *this;
  }

  Frame &text(const char *words) {
    while (*words) put(*words++);
    return *this;
  }

  Frame &letter(char one) {
    put(one);
    return *this;
  }

  Frame &whole(uint32_t number) {
    char digits[10];
    uint8_t count = 0;
    do {
      digits[count++] = static_cast<char>('0' + number % 10);
      number /= 10;
    } while (number);
    while (count) put(digits[--count]);
    return *this;
  }

  // Two decimals; not a number is `nan`, what exceeds 32 bits (a saturated channel of the module) is 2^32.
  Frame &decimal(float number) {
    if (number != number) return text("nan");
    if (number >= 4294967040.0f) return text("4294967296.00");
    if (number < 0) {
      put('-');
      number = -number;
    }
    if (number >= 10000000.0f) {  // the hundredths of so large a float are no digits of it, and would not fit
      whole(static_cast<uint32_t>(number));
      return text(".00");
    }
    const uint32_t hundredths = static_cast<uint32_t>(number * 100.0f + 0.5f);
    whole(hundredths / 100).letter('.');
    put(static_cast<char>('0' + hundredths / 10 % 10));
    put(static_cast<char>('0' + hundredths % 10));
    return *this;
  }

  void end() {
    static const char digits[] = "0123456789ABCDEF";
    const uint16_t crc = crc_;
    port_.write('*');
    for (int8_t shift = 12; shift >= 0; shift -= 4) port_.write(digits[(crc >> shift) & 0xF]);
    port_.write('\r');
    port_.write('\n');
  }

 private:
  void put(char one) {
    port_.write(one);
    crc_ ^= static_cast<uint16_t>(static_cast<uint8_t>(one)) << 8;
    for (uint8_t bit = 0; bit < 8; ++bit) crc_ = (crc_ & 0x8000) ? static_cast<uint16_t>((crc_ << 1) ^ 0x1021) : static_cast<uint16_t>(crc_ << 1);
  }

  Port &port_;
  uint16_t crc_;
  bool is_first_;
};

// A command: one letter, and a number if '=' follows. `?` has none.
struct Command {
  char name;
  bool has_value;
  uint32_t value;
};

// Gathers commands from single characters; anything that is no command comes out with the name '!'.
class CommandReader {
 public:
  CommandReader() : length_(0), is_too_long_(false) {}

  // True when `one` ended a command, which is then in `command`.
  bool take(char one, Command &command) {
    if (one != '\n' && one != '\r') {
      if (length_ < sizeof(held_)) {
        held_[length_++] = one;
      } else {
        is_too_long_ = true;
      }
      return false;
    }
    if (length_ == 0 && !is_too_long_) return false;
    command = understood();
    length_ = 0;
    is_too_long_ = false;
    return true;
  }

 private:
  Command understood() const {
    Command command = {'!', false, 0};
    if (is_too_long_) return command;
    if (length_ == 1) {
      command.name = held_[0];
      return command;
    }
    if (length_ < 3 || held_[1] != '=') return command;
    for (uint8_t i = 2; i < length_; ++i) {
      if (held_[i] < '0' || held_[i] > '9') return command;
      command.value = command.value * 10 + static_cast<uint32_t>(held_[i] - '0');
    }
    command.name = held_[0];
    command.has_value = true;
    return command;
  }

  char held_[10];
  uint8_t length_;
  bool is_too_long_;
};

#endif
