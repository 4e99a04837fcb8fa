/* Runs a kernel of MET that was linked in, on another kind of machine: run_kernel QUESTION ANSWER.

   QUESTION  int64: cases, lanes, inputs, cells, outputs, last tick, rows, columns; then the inputs [case][input]
   ANSWER    the rows [case][row][column], then the outputs [case][output]; all numbers are doubles

   met/trace/entry.py says what met_run takes. */

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void met_run(const double *inputs, double *state, double *rows, double *outputs, int64_t blocks, int64_t first,
             int64_t last, int64_t cases, int64_t row_stride, int64_t state_stride);

static double *zeros(int64_t count) {
    size_t bytes = ((size_t)(count > 0 ? count : 1) * 8 + 63) / 64 * 64;
    double *memory = aligned_alloc(64, bytes);
    if (!memory) exit(3);
    return memset(memory, 0, bytes);
}

int main(int argc, char **argv) {
    int64_t n[8];
    FILE *question = argc == 3 ? fopen(argv[1], "rb") : NULL;
    if (!question || fread(n, 8, 8, question) != 8) return 2;
    int64_t cases = n[0], lanes = n[1], width = n[2], cells = n[3], outs = n[4], last = n[5], rows = n[6], columns = n[7];
    int64_t blocks = (cases + lanes - 1) / lanes;
    double *given = zeros(cases * width), *packed = zeros(blocks * width * lanes), *state = zeros(cells * lanes);
    double *history = zeros(cases * rows * columns), *results = zeros(blocks * (outs ? outs : 1) * lanes);
    if (fread(given, 8, cases * width, question) != (size_t)(cases * width)) return 2;
    for (int64_t c = 0; c < blocks * lanes; c++)
        for (int64_t i = 0; i < width; i++)
            packed[(c / lanes * width + i) * lanes + c % lanes] = given[(c < cases ? c : cases - 1) * width + i];
    met_run(packed, state, columns ? history : NULL, results, blocks, 0, last, cases, rows * columns, 0);
    FILE *answer = fopen(argv[2], "wb");
    if (!answer) return 2;
    fwrite(history, 8, cases * rows * columns, answer);
    for (int64_t c = 0; c < cases; c++)
        for (int64_t i = 0; i < outs; i++) fwrite(&results[(c / lanes * outs + i) * lanes + c % lanes], 8, 1, answer);
    return fclose(answer) ? 2 : 0;
}
