/* @NAME@: @WHAT@
 *
 * @NOTES@
 *
 * C99, no heap, no memory that changes, no dependency but <math.h>: every function may be called from several tasks at
 * once. NaN among the inputs gives NaN.
 */
#ifndef @NAME_UPPER@_H
#define @NAME_UPPER@_H

typedef @REAL@ @NAME@_real;

#define @NAME_UPPER@_OUTPUTS @N_OUTPUTS@

/* The signals at one instant. */
typedef struct {
@FIELDS@
} @NAME@_signals;

/* All outputs: @OUTPUTS_TEXT@. */
void @NAME@_predict(const @NAME@_signals *s, @NAME@_real y[@NAME_UPPER@_OUTPUTS]);

@LIFT_HEADER@#endif
