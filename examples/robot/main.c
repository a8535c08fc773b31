/* The core of a robot's program: it asks `coadjoint serve` for readings and steers by the estimate of its filter.

   robot PORT PERIODS: each period of 0.1 s it sends commands, gets depth and attitude, predicts and updates its filter,
   and steps its own vehicle, which a planner could run ahead. A node of ROS 2 would subscribe where this one receives. */
#define _POSIX_C_SOURCE 200809L

#include "dive.h"
#include "remus.h"

#include <arpa/inet.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

enum { STEPS = 2 };

static remus vehicle;
static dive filter;

/* The numbers of `"key": [...]` in an answer; whether they are there. */
static int numbers(const char *answer, const char *key, double *values, int count) {
    const char *place = strstr(answer, key);
    if (!place || !(place = strchr(place, '['))) return 0;
    for (int i = 0; i < count; i++) {
        char *end;
        values[i] = strtod(place + 1, &end);
        if (end == place + 1) return 0;
        place = end;
    }
    return 1;
}

/* The depth of the estimate: q = R n, whose third component it is. */
static double depth(const double *row) {
    const double *R = row + DIVE_ROW_G, *n = row + DIVE_ROW_N;
    return R[6] * n[0] + R[7] * n[1] + R[8] * n[2];
}

static double limited(double value, double most) { return fmax(-most, fmin(most, value)); }

int main(int count, char **words) {
    if (count != 3) return fprintf(stderr, "robot PORT PERIODS\n"), 2;
    struct sockaddr_in server = {0};
    server.sin_family = AF_INET;
    server.sin_port = htons((unsigned short)atoi(words[1]));
    server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int link = socket(AF_INET, SOCK_DGRAM, 0);
    struct timeval patience = {10, 0};
    setsockopt(link, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    if (link < 0 || connect(link, (struct sockaddr *)&server, sizeof server)) return perror("robot"), 1;
    if (remus_reset(&vehicle) != REMUS_OK) return fprintf(stderr, "robot: no observations at the start\n"), 1;
    dive_reset(&filter);
    double angle = 0.0, before = depth(filter.row), position[3], attitude[4], apart = 0.0;
    for (int k = 0; k < atoi(words[2]); k++) {
        char text[8192];
        int size = snprintf(text, sizeof text,
                            "{\"id\": %d, \"steps\": %d, \"commands\": {\"stern_planes\": %.17g, \"rudder\": 0.0, "
                            "\"propeller\": 15.0}}", k, STEPS, angle);
        if (send(link, text, (size_t)size, 0) < 0) return perror("robot"), 1;
        ssize_t got = recv(link, text, sizeof text - 1, 0);
        if (got < 0) return perror("robot"), 1;
        text[got] = '\0';
        if (!numbers(text, "\"position\"", position, 3) || !numbers(text, "\"quaternion\"", attitude, 4))
            return fprintf(stderr, "robot: %s\n", text), 1;
        vehicle.commands[REMUS_COMMAND_STERN_PLANES] = filter.inputs[DIVE_INPUT_STERN_PLANES] = angle;
        if (remus_step(&vehicle, STEPS) != REMUS_OK) return fprintf(stderr, "robot: the vehicle cannot step\n"), 1;
        for (int i = 0; i < 3; i++) apart = fmax(apart, fabs(vehicle.observations[REMUS_OBSERVATION_Q + i] - position[i]));
        for (int i = 0; i < STEPS; i++)
            if (dive_predict(&filter, REMUS_DT) != DIVE_OK) return fprintf(stderr, "robot: no prediction\n"), 1;
        double measured = position[2] + 0.03 * sin(17.0 * k); /* a gauge that errs by some centimetres */
        if (dive_update_depth(&filter, &measured, NULL) || dive_update_attitude(&filter, attitude, NULL))
            return fprintf(stderr, "robot: no update\n"), 1;
        double now = depth(filter.row), sink = (now - before) / (STEPS * REMUS_DT);
        angle = limited(0.3 * (4.0 - now) - 0.6 * sink, 0.2);
        before = now;
    }
    printf("depth %.4f m, estimated %.4f m; own vehicle apart by at most %.1e m\n", position[2], before, apart);
    return close(link);
}
