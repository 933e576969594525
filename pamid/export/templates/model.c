/* @NAME@: the gas volume of a muscle and what the laws read from it; see @NAME@.h. */
#include "@NAME@.h"

#include <math.h>
#include <stdint.h>

typedef @NAME@_real real;

#include "@NAME@_parameters.h"

/* exp(-t) for t >= 0, without branches so that a compiler can vectorise it: t/ln 2 is rounded to a whole number, which
 * becomes the exponent of a floating number (IEEE 754), and a polynomial takes what is left. Rounding relies on the order
 * in which sums are written, which -ffast-math would change. */
#ifdef __FAST_MATH__
#error "compile without -ffast-math: it is not needed for speed, and it changes results"
#endif
typedef union {
    real x;
    BITS bits;
} number;

/* |x|, and a size with the sign of x. */
static inline real magnitude(real x)
{
    number k;
    k.x = x;
    k.bits &= ~SIGN;
    return k.x;
}

static inline real exp_minus(real t)
{
    /* the lesser of t and the limit, as a sum: a comparison would become a jump */
    const real least = (real)0.5 * ((EXP_LIMIT + t) - magnitude(EXP_LIMIT - t)), q = least * (real)1.4426950408889634074;
    number k;
    real left;
    k.x = ROUNDER - q;
    left = ((ROUNDER - k.x) - q) * (real)0.69314718055994530942;
    k.bits = (k.bits + EXPONENT) << MANTISSA;
    return k.x * (EXP_SERIES(left));
}

static inline real with_sign(real size, real x)
{
    number k, s;
    k.x = size;
    s.x = x;
    k.bits |= s.bits & SIGN;
    return k.x;
}

/* log(1 + e) for 0 <= e <= 1. */
static inline real log_one_plus(real e)
{
    const real s = e / (2 + e), r = s * s;
    return 2 * s * (LOG_SERIES(r));
}

static inline real logistic(real x)
{
    const real e = exp_minus(x < 0 ? -x : x), s = 1 / (1 + e);
    return x < 0 ? e * s : s;
}

#if HAS_NETWORK
static inline real hyperbolic_tangent(real x)
{
    const real e = exp_minus(x < 0 ? -2 * x : 2 * x), t = (1 - e) / (1 + e);
    return x < 0 ? -t : t;
}

#if HIDDEN_LAYERS
/* z = b + W h, with the columns of W one after the other. */
static void forward(int n_in, int n_out, const real *restrict w, const real *restrict b, const real *restrict h,
                    real *restrict z)
{
    int i, left = n_in;
    for (i = 0; i < n_out; i++)
        z[i] = b[i];
    for (; left >= 4; left -= 4, h += 4, w += 4 * n_out) {
        const real h0 = h[0], h1 = h[1], h2 = h[2], h3 = h[3];
        const real *restrict w1 = w + n_out, *restrict w2 = w1 + n_out, *restrict w3 = w2 + n_out;
        for (i = 0; i < n_out; i++)
            z[i] += (w[i] * h0 + w1[i] * h1) + (w2[i] * h2 + w3[i] * h3);
    }
    for (; left > 0; left--, h++, w += n_out)
        for (i = 0; i < n_out; i++)
            z[i] += w[i] * h[0];
}

/* g_in = W^T g_out: several sums side by side, so that a compiler may use vectors without reordering. */
static void backward(int n_in, int n_out, const real *restrict w, const real *restrict g_out, real *restrict g_in)
{
    int i, j, k;
    for (j = 0; j < n_in; j++, w += n_out) {
        real lanes[LANES] = {0}, sum = 0;
        for (i = 0; i + LANES <= n_out; i += LANES)
            for (k = 0; k < LANES; k++)
                lanes[k] += w[i + k] * g_out[i + k];
        for (; i < n_out; i++)
            sum += w[i] * g_out[i];
        for (k = 0; k < LANES; k++)
            sum += lanes[k];
        g_in[j] = sum;
    }
}

/* Replaces z by the activation and puts its slope beside it. */
static void activate(int n, real *restrict z, real *restrict slope)
{
    int i;
    for (i = 0; i < n; i++) {
        const real x = z[i], size = magnitude(x), e = exp_minus(size * ACTIVATION_STRETCH);
#if ACTIVATION == 0 /* softplus: one division serves its slope and its logarithm */
        const real d = 1 / ((1 + e) * (2 + e)), s = e * (1 + e) * d, r = s * s;
        z[i] = (real)0.5 * (x + size) + 2 * s * (LOG_SERIES(r));
        slope[i] = (real)0.5 + (real)0.5 * with_sign((1 - e) * (2 + e) * d, x);
#elif ACTIVATION == 1 /* tanh */
        const real t = with_sign((1 - e) / (1 + e), x);
        z[i] = t;
        slope[i] = 1 - t * t;
#else /* silu */
        const real s = (real)0.5 + (real)0.5 * with_sign((1 - e) / (1 + e), x);
        z[i] = x * s;
        slope[i] = s + x * (s - s * s);
#endif
    }
}
#endif

/* Standardised inputs, clamped smoothly to the range of the data, and their slopes. */
static void scale_inputs(const real x[INPUTS], real xi[INPUTS], real slope[INPUTS])
{
    int j;
    for (j = 0; j < INPUTS; j++) {
        const real z = (x[j] - input_mean[j]) / input_spread[j];
        if (input_saturated[j]) {
            const real root = SQUARE_ROOT(1 + z * z);
            xi[j] = z / root;
            slope[j] = 1 / (root * root * root) / input_spread[j];
        } else if (z > input_upper[j]) {
            const real t = hyperbolic_tangent((z - input_upper[j]) / INPUT_FADE);
            xi[j] = input_upper[j] + INPUT_FADE * t;
            slope[j] = (1 - t * t) / input_spread[j];
        } else if (z < input_lower[j]) {
            const real t = hyperbolic_tangent((input_lower[j] - z) / INPUT_FADE);
            xi[j] = input_lower[j] - INPUT_FADE * t;
            slope[j] = (1 - t * t) / input_spread[j];
        } else {
            xi[j] = z;
            slope[j] = 1 / input_spread[j];
        }
    }
}

/* Value of the network forwards, its gradient backwards: twice the work of the value, for any number of inputs. */
static void network(const real x[INPUTS], real *value, real *by_eps, real *by_P)
{
    real xi[INPUTS], scale[INPUTS], gradient[INPUTS], sum = last_bias;
    int i;
#if HIDDEN_LAYERS
    real h[2][WIDEST], slope[HIDDEN_LAYERS][WIDEST];
    const real *below = xi;
    int l;
    scale_inputs(x, xi, scale);
    for (l = 0; l < HIDDEN_LAYERS; l++) {
        forward(widths[l], widths[l + 1], weights[l], biases[l], below, h[l % 2]);
        activate(widths[l + 1], h[l % 2], slope[l]);
        below = h[l % 2];
    }
    for (i = 0; i < widths[HIDDEN_LAYERS]; i++)
        sum += last_weights[i] * below[i];
    for (i = 0; i < widths[HIDDEN_LAYERS]; i++)
        h[HIDDEN_LAYERS % 2][i] = last_weights[i];
    for (l = HIDDEN_LAYERS - 1; l >= 0; l--) {
        real *g = h[(l + 1) % 2];
        for (i = 0; i < widths[l + 1]; i++)
            g[i] *= slope[l][i];
        backward(widths[l], widths[l + 1], weights[l], g, l ? h[l % 2] : gradient);
    }
#else
    scale_inputs(x, xi, scale);
    for (i = 0; i < INPUTS; i++) {
        sum += last_weights[i] * xi[i];
        gradient[i] = last_weights[i];
    }
#endif
    *value = VOLUME_SCALE * sum;
    *by_eps = VOLUME_SCALE * gradient[0] * scale[0];
    *by_P = VOLUME_SCALE * gradient[2] * scale[2];
}
#endif

#if HAS_ANCHOR
static inline real braid(real eps)
{
    const real u = eps / ANCHOR_MAX_CONTRACTION;
    return ANCHOR_LENGTH_AREA * (1 - u) * (1 + ANCHOR_CURVATURE * u);
}

/* Share phi of the gauge pressure that reaches the braid, and its derivative by u = p/s, at several contractions. */
static void contact(const real *restrict eps, real u, real *restrict phi, real *restrict slope)
{
    int k;
    if (u > CONTACT_SMALL || u < -CONTACT_SMALL)
        for (k = 0; k < POINTS; k++) {
            const real t = (eps[k] > 0 ? eps[k] : 0) / ANCHOR_CONTACT_CONTRACTION;
            const real x = ANCHOR_CONTACT_PRESSURE * (exp_minus(t) - 1), y = x + u; /* x is never positive */
            const real e = exp_minus(y < 0 ? -y : y);
            const real rise = (y > 0 ? y : 0) + log_one_plus(e) - log_one_plus(exp_minus(-x));
            phi[k] = rise / u;
            slope[k] = ((y > 0 ? 1 : e) / (1 + e) - phi[k]) / u;
        }
    else /* the quotient is 0/0 at u = 0: a series about the middle of the stretch */
        for (k = 0; k < POINTS; k++) {
            const real t = (eps[k] > 0 ? eps[k] : 0) / ANCHOR_CONTACT_CONTRACTION, v = u * u;
            const real m = logistic(ANCHOR_CONTACT_PRESSURE * (exp_minus(t) - 1) + u / 2), a = m * (1 - m);
            const real even = (real)0.5 + (1 - 6 * a) * v / 48 + (1 - 30 * a + 120 * a * a) * v * v / 3840;
            phi[k] = m + a * (1 - 2 * m) * v / 24 * (1 + (1 - 12 * a) * v / 80);
            slope[k] = a * (even + (1 - 2 * m) * u * ((real)1 / 12 + (1 - 12 * a) * v / 480));
        }
}

/* The geometric volume: its slope integrated over the contraction by Gauss-Legendre quadrature. */
static void anchor(real eps, real P, real *V, real *V_eps, real *V_P)
{
    const real p = P - ANCHOR_AMBIENT;
    real at[POINTS], phi[POINTS], slope[POINTS], sum = 0, rise = 0;
    int k;
    for (k = 0; k < POINTS; k++)
        at[k] = eps * anchor_nodes[k];
    contact(at, p / ANCHOR_CONTACT_WIDTH, phi, slope);
    for (k = 0; k < POINTS; k++) {
        const real g = anchor_weights[k] * braid(at[k]);
        sum += g * phi[k];
        rise += g * slope[k];
    }
    *V = ANCHOR_REST_VOLUME + ANCHOR_STRETCH * p * (1 - eps) + eps * sum;
    *V_eps = braid(eps) * phi[POINTS - 1] - ANCHOR_STRETCH * p; /* the last point is eps itself, with no weight */
    *V_P = ANCHOR_STRETCH * (1 - eps) + eps * rise / ANCHOR_CONTACT_WIDTH;
}
#endif

void @NAME@_volume(const @NAME@_state *s, @NAME@_jet *jet)
{
    real V = 0, V_eps = 0, V_P = 0;
#if HAS_ANCHOR
    anchor(s->eps, s->P, &V, &V_eps, &V_P);
#endif
#if HAS_NETWORK
    {
        const real x[INPUTS] = {s->eps, s->deps, s->P, s->dP};
        real value, by_eps, by_P;
        network(x, &value, &by_eps, &by_P);
        V += value;
        V_eps += by_eps;
        V_P += by_P;
    }
#endif
    jet->V = VOLUME_FACTOR * V + VOLUME_OFFSET;
    jet->V_eps = VOLUME_FACTOR * V_eps;
    jet->V_P = VOLUME_FACTOR * V_P;
}

@FUNCTIONS@
