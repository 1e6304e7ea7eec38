// What differs between boards: the number of the board's start, which is kept where power cannot take it.
// This file is the same in both sketches.
#ifndef LIDARSPECTRA_BOARD_H
#define LIDARSPECTRA_BOARD_H

#include <Arduino.h>

#if defined(__AVR__) || defined(LIDARSPECTRA_HAS_EEPROM)
#include <EEPROM.h>

// Count this start of the board. Two cells of the EEPROM, good for 100,000 starts.
inline uint16_t count_start() {
  uint16_t starts = static_cast<uint16_t>(EEPROM.read(0)) | static_cast<uint16_t>(EEPROM.read(1)) << 8;
  ++starts;
  EEPROM.write(0, starts & 0xFF);
  EEPROM.write(1, starts >> 8);
  return starts;
}
#else
// A board without EEPROM takes a number from the noise of an open input: another one at each start, as good as always.
inline uint16_t count_start() {
  uint16_t noise = 0;
  for (uint8_t i = 0; i < 64; ++i) noise = static_cast<uint16_t>((noise << 1 | noise >> 15) ^ analogRead(A0) ^ micros());
  return noise;
}
#endif

#endif
