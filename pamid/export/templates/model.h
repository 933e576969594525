/* @NAME@: @WHAT@
 *
 * @NOTES@
 *
 * C99, no heap, no global state that changes, no dependency but sqrt() of <math.h>: every function may be called from
 * several tasks at once. It needs about @NAME_UPPER@_STACK bytes of stack and as many bytes of constants as
 * @NAME_UPPER@_CONSTANTS says. Derivatives are analytic. NaN among the inputs gives NaN.
 */
#ifndef @NAME_UPPER@_H
#define @NAME_UPPER@_H

typedef @REAL@ @NAME@_real;

#define @NAME_UPPER@_OUTPUTS @N_OUTPUTS@
#define @NAME_UPPER@_STACK @STACK@
#define @NAME_UPPER@_CONSTANTS @CONSTANTS@

@READING@/* The signals of one muscle at one instant@WHAT_MEMORY@. */
typedef struct {
    @NAME@_real eps;  /* contraction ratio (L0 - L)/L0, dimensionless */
    @NAME@_real deps; /* its rate, 1/s */
    @NAME@_real P;    /* gas pressure, Pa, absolute */
    @NAME@_real dP;   /* its rate, Pa/s */@MEMORY_FIELD@
} @NAME@_state;@MEMORY_PROTOTYPES@

/* The gas volume and its derivatives. */
typedef struct {
    @NAME@_real V;     /* m^3 */
    @NAME@_real V_eps; /* dV/deps, m^3 */
    @NAME@_real V_P;   /* dV/dP, m^3/Pa */
} @NAME@_jet;

/* Volume and derivatives. */
void @NAME@_volume(const @NAME@_state *s, @NAME@_jet *jet);

/* All predictions: @OUTPUTS_TEXT@; the volume behind them as well if jet is not a null pointer. */
void @NAME@_predict(const @NAME@_state *s, @NAME@_real y[@NAME_UPPER@_OUTPUTS], @NAME@_jet *jet);

/* The same of n states, four at a time in one pass over the weights, which takes a half to a third of the time; the
 * last digits may differ from those of one state. jet holds n volumes or is a null pointer. */
void @NAME@_predict_rows(int n, const @NAME@_state *s, @NAME@_real (*y)[@NAME_UPPER@_OUTPUTS], @NAME@_jet *jet);

@PROTOTYPES@

#endif
