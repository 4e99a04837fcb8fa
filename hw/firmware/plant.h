/* One motor bed as simulated. Everything in SI; the state is inside. MET writes plant.c, from the model that batch
   runs. */
#ifndef PLANT_H
#define PLANT_H

/* s, of one tick */
extern const double plant_period;

/* Begins anew: a shaft that has turned at `rate` rad/s for long, at angle 0; noise from its beginning, of this seed and
   repeat. */
void plant_start(double rate, double seed, double repeat);

/* One tick under what the amplifiers hold: V of the drive motor, A of the load motor. */
void plant_tick(double voltage, double current);

/* The filtered rate as the computer reads it, rad/s. */
double plant_rate(void);

/* The shaft itself: rad/s and rad. */
double plant_shaft_rate(void);
double plant_shaft_angle(void);

#endif
