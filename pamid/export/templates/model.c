/* @NAME@: the gas volume of a muscle and what the laws read from it; see @NAME@.h. */
#include "@NAME@.h"

#include <math.h>
#include <stdint.h>

typedef @NAME@_real real;

#include "@NAME@_parameters.h"

/* Inlined even where a compiler finds it long: what is constant at the call decides how loops become vectors. */
#ifdef __GNUC__
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif

/* On x86-64 there is a second version for processors with AVX2, chosen as the program runs, whatever the options say. */
#if defined(__GNUC__) && defined(__x86_64__) && !defined(@NAME_UPPER@_ONE_VERSION)
#define HAS_WIDE 1
#ifdef __clang__
#define WIDE __attribute__((target("avx2,fma")))
#else
#define WIDE __attribute__((target("avx2,fma"), optimize("fp-contract=fast")))
#endif
#define LANES ((int)(32 / sizeof(real)))
typedef real lanes __attribute__((vector_size(32), aligned(sizeof(real)), may_alias));
#if defined(__AVX2__) && defined(__FMA__)
#define FITS_WIDE 1
#else
#define FITS_WIDE (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
#endif
#else
#define HAS_WIDE 0
#endif

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
INLINE real magnitude(real x)
{
    number k;
    k.x = x;
    k.bits &= ~SIGN;
    return k.x;
}

INLINE real exp_minus(real t)
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

INLINE real with_sign(real size, real x)
{
    number k, s;
    k.x = size;
    s.x = x;
    k.bits |= s.bits & SIGN;
    return k.x;
}

/* log((1 + a)/(1 + b)) for a and b of 0 to 1. */
INLINE real log_ratio(real a, real b)
{
    const real s = (a - b) / (2 + a + b), r = s * s;
    return 2 * s * (LOG_SERIES(r));
}

/* 1/(1 + exp(-x)) from e = exp(-|x|), and the positive part of x: without a comparison, as above. */
INLINE real logistic(real x, real e)
{
    return (real)0.5 + (real)0.5 * with_sign((1 - e) / (1 + e), x);
}

INLINE real positive(real x)
{
    return (real)0.5 * (x + magnitude(x));
}

#if HAS_NETWORK
INLINE real hyperbolic_tangent(real x)
{
    const real e = exp_minus(x < 0 ? -2 * x : 2 * x), t = (1 - e) / (1 + e);
    return x < 0 ? -t : t;
}

#if HIDDEN_LAYERS
/* One block of sums of z = b + W h, the columns of W one after the other: small enough to stay in registers. The
 * rows of states and the size of the block are constants wherever this is inlined. */
INLINE void block(const int rows, const int size, int n_in, int stride, const real *restrict w, const real *restrict b,
                  const real *restrict h, real *restrict z)
{
    real sum[SUMS];
    int j, r, k;
    for (r = 0; r < rows; r++)
        for (k = 0; k < size; k++)
            sum[r * size + k] = b ? b[k] : 0;
    for (j = 0; j < n_in; j++, w += stride)
        for (r = 0; r < rows; r++) {
            const real x = h[r * WIDEST + j];
            for (k = 0; k < size; k++)
                sum[r * size + k] = MULTIPLY_ADD(w[k], x, sum[r * size + k]);
        }
    for (r = 0; r < rows; r++)
        for (k = 0; k < size; k++)
            z[r * WIDEST + k] = sum[r * size + k];
}

#if HAS_WIDE
/* The same by vectors of 32 bytes, which a compiler does not always find in the loops above. */
INLINE void wide_block(const int rows, const int size, int n_in, int stride, const real *restrict w,
                       const real *restrict b, const real *restrict h, real *restrict z)
{
    const int n = size / LANES;
    lanes sum[SUMS];
    int j, r, k;
    for (r = 0; r < rows; r++)
        for (k = 0; k < n; k++)
            sum[r * n + k] = b ? *(const lanes *)(b + k * LANES) : (lanes){0};
    for (j = 0; j < n_in; j++, w += stride)
        for (r = 0; r < rows; r++) {
            const real x = h[r * WIDEST + j];
            for (k = 0; k < n; k++)
                sum[r * n + k] += *(const lanes *)(w + k * LANES) * x;
        }
    for (r = 0; r < rows; r++)
        for (k = 0; k < n; k++)
            *(lanes *)(z + r * WIDEST + k * LANES) = sum[r * n + k];
}
#else
#define wide_block block
#endif

/* z = b + W h of some rows of h in one pass over W, whose columns are filled up with zeros to whole blocks. */
INLINE void product(const int rows, const int wide, int n_in, int n_out, const real *restrict w, const real *restrict b,
                    const real *restrict h, real *restrict z)
{
    const int stride = (n_out + BLOCK - 1) / BLOCK * BLOCK, size = SUMS / rows;
    int i = 0;
    for (; i + size <= stride; i += size)
        if (wide)
            wide_block(rows, size, n_in, stride, w + i, b ? b + i : 0, h, z + i);
        else
            block(rows, size, n_in, stride, w + i, b ? b + i : 0, h, z + i);
    for (; i < stride; i += BLOCK)
        if (wide)
            wide_block(rows, BLOCK, n_in, stride, w + i, b ? b + i : 0, h, z + i);
        else
            block(rows, BLOCK, n_in, stride, w + i, b ? b + i : 0, h, z + i);
}

/* Replaces z by the activation and puts its slope beside it. */
INLINE void activate(int n, real *restrict z, real *restrict slope)
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

@NETWORK_INPUTS@

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
INLINE void network(const int rows, const int wide, const @NAME@_state *s, real *value, real *by_eps, real *by_P)
{
    real scale[AT_ONCE][INPUTS], h[2][AT_ONCE][WIDEST];
#if HIDDEN_LAYERS
    real slope[HIDDEN_LAYERS][AT_ONCE][WIDEST];
    int l;
#endif
    int i, r;
    (void)wide; /* a network without hidden layers has no products */
    for (r = 0; r < rows; r++) {
        real x[INPUTS];
        network_inputs(s + r, x);
        scale_inputs(x, h[0][r], scale[r]);
    }
#if HIDDEN_LAYERS
    for (l = 0; l < HIDDEN_LAYERS; l++) {
        product(rows, wide, widths[l], widths[l + 1], weights + weights_at[l], biases + l * WIDEST, h[l % 2][0],
                h[(l + 1) % 2][0]);
        for (r = 0; r < rows; r++)
            activate(widths[l + 1], h[(l + 1) % 2][r], slope[l][r]);
    }
#endif
    for (r = 0; r < rows; r++) {
        real *top = h[HIDDEN_LAYERS % 2][r], sum = last_bias;
        for (i = 0; i < widths[HIDDEN_LAYERS]; i++) {
            sum += last_weights[i] * top[i];
            top[i] = last_weights[i];
        }
        value[r] = VOLUME_SCALE * sum;
    }
#if HIDDEN_LAYERS
    for (l = HIDDEN_LAYERS - 1; l >= 0; l--) {
        for (r = 0; r < rows; r++)
            for (i = 0; i < widths[l + 1]; i++)
                h[(l + 1) % 2][r][i] *= slope[l][r][i];
        product(rows, wide, widths[l + 1], widths[l], transposed + transposed_at[l], 0, h[(l + 1) % 2][0],
                h[l % 2][0]);
    }
#endif
    for (r = 0; r < rows; r++) {
        by_eps[r] = VOLUME_SCALE * h[0][r][0] * scale[r][0];
        by_P[r] = VOLUME_SCALE * h[0][r][2] * scale[r][2];
    }
}
#endif

#if HAS_ANCHOR
INLINE real braid(real eps)
{
    const real u = eps / ANCHOR_MAX_CONTRACTION;
    return ANCHOR_LENGTH_AREA * (1 - u) * (1 + ANCHOR_CURVATURE * u);
}

/* Share phi of the gauge pressure that reaches the braid, and its derivative by u = p/s, at several contractions. */
INLINE void contact(const real *restrict eps, real u, real *restrict phi, real *restrict slope)
{
    const real per_u = 1 / u;
    int k;
    if (u > CONTACT_SMALL || u < -CONTACT_SMALL)
        for (k = 0; k < POINTS; k++) {
            const real t = positive(eps[k]) * (1 / ANCHOR_CONTACT_CONTRACTION);
            const real x = ANCHOR_CONTACT_PRESSURE * (exp_minus(t) - 1), y = x + u; /* x is never positive */
            const real e = exp_minus(magnitude(y)), left = log_ratio(e, exp_minus(-x));
            /* the slope from what phi and the logistic function lack of 1, or of 0: their difference loses digits */
            const real above = (real)0.5 + (real)0.5 * with_sign(1, y);
            phi[k] = (positive(y) + left) * per_u;
            slope[k] = -(with_sign(e / (1 + e), y) + (above * x + left) * per_u) * per_u;
        }
    else /* the quotient is 0/0 at u = 0: a series about the middle of the stretch */
        for (k = 0; k < POINTS; k++) {
            const real t = positive(eps[k]) * (1 / ANCHOR_CONTACT_CONTRACTION), v = u * u;
            const real y = ANCHOR_CONTACT_PRESSURE * (exp_minus(t) - 1) + u / 2;
            const real m = logistic(y, exp_minus(magnitude(y))), a = m * (1 - m);
            const real even = (real)0.5 + (1 - 6 * a) * v / 48 + (1 - 30 * a + 120 * a * a) * v * v / 3840;
            phi[k] = m + a * (1 - 2 * m) * v / 24 * (1 + (1 - 12 * a) * v / 80);
            slope[k] = a * (even + (1 - 2 * m) * u * ((real)1 / 12 + (1 - 12 * a) * v / 480));
        }
}

/* The geometric volume: its slope integrated over the contraction by Gauss-Legendre quadrature. */
INLINE void anchor(real eps, real P, real *V, real *V_eps, real *V_P)
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
    *V_eps = braid(eps) * phi[LAST] - ANCHOR_STRETCH * p; /* that point is eps itself, with no weight */
    *V_P = ANCHOR_STRETCH * (1 - eps) + eps * rise / ANCHOR_CONTACT_WIDTH;
}
#endif

INLINE void volumes(const int rows, const int wide, const @NAME@_state *s, @NAME@_jet *jet)
{
    int r;
#if HAS_NETWORK
    real value[AT_ONCE], by_eps[AT_ONCE], by_P[AT_ONCE];
    network(rows, wide, s, value, by_eps, by_P);
#else
    (void)wide;
#endif
    for (r = 0; r < rows; r++) {
        real V = 0, V_eps = 0, V_P = 0;
#if HAS_ANCHOR
        anchor(s[r].eps, s[r].P, &V, &V_eps, &V_P);
#endif
#if HAS_NETWORK
        V += value[r];
        V_eps += by_eps[r];
        V_P += by_P[r];
#endif
        jet[r].V = VOLUME_FACTOR * V + VOLUME_OFFSET;
        jet[r].V_eps = VOLUME_FACTOR * V_eps;
        jet[r].V_P = VOLUME_FACTOR * V_P;
    }
}

#if HAS_WIDE
WIDE static void wide_volume(const @NAME@_state *s, @NAME@_jet *jet)
{
    volumes(1, 1, s, jet);
}

WIDE static void wide_volumes(const @NAME@_state *s, @NAME@_jet *jet)
{
    volumes(AT_ONCE, 1, s, jet);
}
#endif

void @NAME@_volume(const @NAME@_state *s, @NAME@_jet *jet)
{
#if HAS_WIDE
    if (FITS_WIDE) {
        wide_volume(s, jet);
        return;
    }
#endif
    volumes(1, 0, s, jet);
}

static void some_volumes(const @NAME@_state *s, @NAME@_jet *jet)
{
#if HAS_WIDE
    if (FITS_WIDE) {
        wide_volumes(s, jet);
        return;
    }
#endif
    volumes(AT_ONCE, 0, s, jet);
}

@FUNCTIONS@

void @NAME@_predict(const @NAME@_state *s, real y[@NAME_UPPER@_OUTPUTS], @NAME@_jet *jet)
{
    @NAME@_jet own;
    @NAME@_volume(s, jet ? jet : &own);
    formulas(s, jet ? jet : &own, y);
}

void @NAME@_predict_rows(int n, const @NAME@_state *s, real (*y)[@NAME_UPPER@_OUTPUTS], @NAME@_jet *jet)
{
    for (; n >= AT_ONCE; n -= AT_ONCE, s += AT_ONCE, y += AT_ONCE) {
        @NAME@_jet own[AT_ONCE], *const j = jet ? jet : own;
        int r;
        some_volumes(s, j);
        for (r = 0; r < AT_ONCE; r++)
            formulas(s + r, j + r, y[r]);
        jet = jet ? jet + AT_ONCE : jet;
    }
    for (; n > 0; n--, s++, y++, jet = jet ? jet + 1 : jet)
        @NAME@_predict(s, *y, jet);
}

@SINGLE@@MEMORY_FUNCTIONS@
