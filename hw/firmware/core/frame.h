/* Frames as they go over the wire: COBS(payload, CRC) 0x00 (docs/protocol.md, "A frame").

   Pure functions of bytes: no state, no heap, no library. */
#ifndef FRAME_H
#define FRAME_H

#include <stddef.h>
#include <stdint.h>

/* Bytes of the longest frame to a device and from one, the ending 0x00 included, and of the longest payload. */
#define FRAME_IN 16u
#define FRAME_OUT 208u
#define FRAME_PAYLOAD 200u

/* CRC-16 of `count` bytes: polynomial 0x1021, from 0xFFFF, not reflected. Of "123456789": 0x29B1. */
uint16_t frame_crc(const uint8_t *bytes, size_t count);

/* The frame of a payload of 1 to FRAME_PAYLOAD bytes, into `frame`, which has room for FRAME_OUT. Answers its length,
   0x00 included. */
size_t frame_encode(uint8_t *frame, const uint8_t *payload, size_t count);

/* The payload of a frame's `count` bytes, at most FRAME_IN - 1, its 0x00 left out. `payload` has room for FRAME_IN.
   Answers the payload's length without CRC, of 3 or more; 0 where the bytes are no frame. */
size_t frame_decode(uint8_t *payload, const uint8_t *bytes, size_t count);

#endif
