/* Gymnasium's MountainCarContinuous-v0 under linear maps in Euclidean cells, type for type: float32 states, float64
 * sums. Actions and cosines are known up to a bound; where it decides, all ways are followed. */
#include <math.h>

enum { MOST_CELLS = 64, MOST_STEPS = 1000 };

typedef struct {
    const double *slopes, *offsets; /* (k, 2), (k,): how near a codeword is, as a linear function of the state */
    const double *maps;             /* (k, 3): the action per position, per velocity, and its bias */
    double tie, sums, cosine;       /* up to what nearness, an action (as a share of its terms), a cosine are known */
    int k, most_steps, most_ways;
} Program;

typedef struct {
    double least, most; /* returns */
    int longest, left;  /* steps; episodes that did not arrive */
    int doubts;         /* how often several ways were followed; -1: they were too many, and not all were */
} Ends;

typedef struct {
    float x, v;
    int ended;
} State;

/* The last episode without a doubt. An episode that comes to one of its states at the same time goes on as it did. */
typedef struct {
    State states[MOST_STEPS];  /* after so many steps */
    double rest[MOST_STEPS];   /* return from there on */
    int n, left;               /* steps; 0: there is none */
} Path;

/* The state after a step in which the velocity changes by `push`. Python's own numbers take on the type of their
 * partner: where the speed is at its limit, all that follows is float32. */
static State moved(float x, float v, double push) {
    double velocity = v + push, after = x + velocity, wall = -1.2, end = 0.6, flag = 0.45;
    if (fabs(velocity) > 0.07) {
        velocity = copysign(0.07, velocity);
        after = x + (float)velocity;
        wall = -1.2f, end = 0.6f, flag = 0.45f;
    }
    if (after > end) after = end;
    if (after <= wall) {
        after = wall;
        if (velocity < 0) velocity = 0;
    }
    return (State){(float)after, (float)velocity, after >= flag && velocity >= 0};
}

static double clipped(double action) { return action < -1 ? -1 : action > 1 ? 1 : action; }

static void end(Ends *ends, double total, int t) {
    ends->least = fmin(ends->least, total), ends->most = fmax(ends->most, total);
    if (t > ends->longest) ends->longest = t;
}

static void play(const Program *p, State s, int t, double total, Ends *ends, Path *path);

/* One of the states after step `t` with the map of `cell`; episodes through the others are played. */
static State step(const Program *p, State s, int cell, int t, double *total, Ends *ends) {
    const double *map = p->maps + 3 * cell;
    double along = map[0] * s.x, across = map[1] * s.v;
    double raw = along + across + map[2], slack = p->sums * (fabs(along) + fabs(across) + fabs(map[2]));
    double least = clipped(raw - slack), most = clipped(raw + slack), pull = cos((double)(3.0f * s.x));
    State low = moved(s.x, s.v, least * 0.0015 - 0.0025 * (pull + p->cosine));
    State high = moved(s.x, s.v, most * 0.0015 - 0.0025 * (pull - p->cosine));
    *total -= 0.1 * fmax(least * least, most * most);
    if (low.x == high.x && low.v == high.v && low.ended == high.ended) return low;
    if (high.ended) end(ends, *total + 100, t);
    if (high.v < low.v) { /* the wall may stop the car, or not: too rare to follow */
        ends->doubts = -1;
        return low;
    }
    int ways = 0;
    for (float x = low.x; x <= high.x; x = nextafterf(x, INFINITY))
        for (float v = low.v; v <= high.v; v = nextafterf(v, INFINITY)) {
            if (++ways > p->most_ways || ends->doubts < 0) {
                ends->doubts = -1;
                return low;
            }
            if (!low.ended && ways > 1) play(p, (State){x, v, 0}, t, *total, ends, 0);
        }
    ends->doubts += ends->doubts >= 0;
    return low;
}

/* Adds to `ends` how episodes end that are in `s` after `t` steps, with `total` for them. `path`: 0, or an earlier one
 * to join; it becomes this one. */
static void play(const Program *p, State s, int t, double total, Ends *ends, Path *path) {
    int first = t, doubts = ends->doubts, left = 0;
    while (!s.ended && t < p->most_steps && ends->doubts >= 0) {
        if (path) {
            if (t < path->n && path->states[t].x == s.x && path->states[t].v == s.v) break;
            path->states[t] = s, path->rest[t] = total;
        }
        double near[MOST_CELLS], best = -INFINITY, before = total;
        int cell = 0;
        for (int i = 0; i < p->k; i++) {
            near[i] = p->slopes[2 * i] * s.x + p->slopes[2 * i + 1] * s.v - p->offsets[i];
            if (near[i] > best) cell = i, best = near[i];
        }
        State after = step(p, s, cell, ++t, &total, ends);
        for (int i = 0; i < p->k; i++)
            if (i != cell && near[i] >= best - p->tie && ends->doubts >= 0) {
                double other = before;
                ends->doubts++;
                play(p, step(p, s, i, t, &other, ends), t, other, ends, 0);
            }
        s = after;
    }
    int played = t, joins = path && t < path->n && !s.ended && t < p->most_steps && ends->doubts >= 0;
    if (joins) {
        total += path->rest[t], left = path->left, t = path->n;
    } else {
        total += s.ended ? 100 : 0, left = !s.ended;
    }
    end(ends, total, t);
    ends->left += left;
    if (path) {
        for (int i = first; i < played; i++) path->rest[i] = total - path->rest[i];
        path->n = ends->doubts == doubts ? t : 0, path->left = left;
    }
}

/* How the episodes end that are in the states (n, 2) after one step, with these returns so far. */
void play_all(const Program *p, long n, const float *states, const double *returns, Ends *ends) {
    Path path = {.n = 0};
    for (long i = 0; i < n; i++) {
        ends[i] = (Ends){INFINITY, -INFINITY, 0, 0, 0};
        play(p, (State){states[2 * i], states[2 * i + 1], 0}, 1, returns[i], ends + i, &path);
    }
}

/* One step each from states (n, 2) with actions (n,). */
void step_all(long n, const float *states, const double *actions, State *after) {
    for (long i = 0; i < n; i++) {
        float x = states[2 * i];
        after[i] = moved(x, states[2 * i + 1], clipped(actions[i]) * 0.0015 - 0.0025 * cos((double)(3.0f * x)));
    }
}
