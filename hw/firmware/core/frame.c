#include "frame.h"

#define CRC_BYTES 2u
/* kind and sequence number */
#define LEAST_PAYLOAD 3u

uint16_t frame_crc(const uint8_t *bytes, size_t count)
{
    /* The remainders of four bits: 32 bytes of table for a quarter of the time of bit by bit. */
    static const uint16_t of_nibble[16] = {
        0x0000u, 0x1021u, 0x2042u, 0x3063u, 0x4084u, 0x50A5u, 0x60C6u, 0x70E7u,
        0x8108u, 0x9129u, 0xA14Au, 0xB16Bu, 0xC18Cu, 0xD1ADu, 0xE1CEu, 0xF1EFu,
    };
    uint32_t crc = 0xFFFFu;
    for (size_t k = 0u; k < count; k++) {
        crc = (crc << 4) ^ of_nibble[((crc >> 12) ^ ((uint32_t)bytes[k] >> 4)) & 0xFu];
        crc = (crc << 4) ^ of_nibble[((crc >> 12) ^ bytes[k]) & 0xFu];
    }
    return (uint16_t)(crc & 0xFFFFu);
}

size_t frame_encode(uint8_t *frame, const uint8_t *payload, size_t count)
{
    const uint16_t crc = frame_crc(payload, count);
    size_t length = 1u; /* the first byte says how far it is to the first zero */
    size_t mark = 0u;
    for (size_t k = 0u; k < count + CRC_BYTES; k++) {
        /* A payload of 200 bytes is below the 254 after which a stretch without zeros has to be broken. */
        uint8_t byte;
        if (k < count) {
            byte = payload[k];
        } else {
            byte = (uint8_t)((k == count) ? (crc & 0xFFu) : ((uint32_t)crc >> 8));
        }
        if (byte == 0u) {
            frame[mark] = (uint8_t)(length - mark);
            mark = length;
        } else {
            frame[length] = byte;
        }
        length++;
    }
    frame[mark] = (uint8_t)(length - mark);
    frame[length] = 0u;
    return length + 1u;
}

size_t frame_decode(uint8_t *payload, const uint8_t *bytes, size_t count)
{
    size_t length = 0u;
    size_t at = 0u;
    while (at < count) {
        const size_t next = at + bytes[at];
        if ((bytes[at] == 0u) || (next > count)) {
            return 0u;
        }
        for (size_t k = at + 1u; k < next; k++) {
            payload[length] = bytes[k];
            length++;
        }
        if (next < count) {
            payload[length] = 0u;
            length++;
        }
        at = next;
    }
    if (length < LEAST_PAYLOAD + CRC_BYTES) {
        return 0u;
    }
    length -= CRC_BYTES;
    const uint32_t told = (uint32_t)payload[length] | ((uint32_t)payload[length + 1u] << 8);
    return (told == frame_crc(payload, length)) ? length : 0u;
}
